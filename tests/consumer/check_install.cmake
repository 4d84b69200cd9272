# cmake -D BUILD=… -D PROJECT=… -D WORK=… -D COMPILER=… -D FLAGS=… -D MODULES=… -D VIEWER=…
#       -D GENERATOR=… -D CUDA=… -D SHARED=… -P check_install.cmake
# Installs the build tree into a fresh prefix, then configures, builds and runs the consumer
# against it, where no library of windows, OpenGL or CUDA is found.
function(run)
  execute_process(COMMAND ${ARGV} RESULT_VARIABLE result OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT result EQUAL 0)
    list(JOIN ARGV " " command)
    message(FATAL_ERROR "${command}\n${output}")
  endif()
endfunction()

cmake_minimum_required(VERSION 3.25)
separate_arguments(MODULES)
file(REMOVE_RECURSE ${WORK})
set(prefix ${WORK}/prefix)
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${prefix})
run(${CMAKE_COMMAND} -S ${PROJECT} -B ${WORK}/build -G ${GENERATOR}
  -DCMAKE_CXX_COMPILER=${COMPILER} -DCMAKE_CXX_FLAGS=${FLAGS} -DCMAKE_PREFIX_PATH=${prefix}
  -DCMAKE_DISABLE_FIND_PACKAGE_glm=ON -DCMAKE_DISABLE_FIND_PACKAGE_glfw3=ON
  -DCMAKE_DISABLE_FIND_PACKAGE_CUDAToolkit=ON)
run(${CMAKE_COMMAND} --build ${WORK}/build)
run(${WORK}/build/consumer ${WORK} ${MODULES})
run(${WORK}/build/store ${WORK}/sphere.zarr ${WORK}/surface.ply)
foreach(program array simulation cancel)
  run(${WORK}/build/${program})
endforeach()

# The ranks of a simulation, as many as they are, have one surface.
find_program(mpirun mpirun)
if(mpirun AND EXISTS ${WORK}/build/in_situ)
  foreach(ranks 1 3)
    execute_process(COMMAND ${CMAKE_COMMAND} -E env OMPI_ALLOW_RUN_AS_ROOT=1
      OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 OMPI_MCA_rmaps_base_oversubscribe=1
      ${mpirun} -n ${ranks} ${WORK}/build/in_situ WORKING_DIRECTORY ${WORK}
      OUTPUT_VARIABLE of_${ranks} COMMAND_ERROR_IS_FATAL ANY)
  endforeach()
  if(NOT of_1 STREQUAL of_3 OR NOT of_1 MATCHES "step 20: [1-9][0-9]* triangles")
    message(FATAL_ERROR "ranks made another surface than one process:\n${of_1}${of_3}")
  endif()
endif()

# The program that uses CUDA itself, run where there is a device.
if(CUDA)
  run(${CMAKE_COMMAND} -DDEVICE=ON -DCMAKE_DISABLE_FIND_PACKAGE_CUDAToolkit=OFF ${WORK}/build)
  run(${CMAKE_COMMAND} --build ${WORK}/build --target device)
  execute_process(COMMAND nvidia-smi RESULT_VARIABLE no_device OUTPUT_QUIET ERROR_QUIET)
  if(no_device EQUAL 0)
    run(${WORK}/build/device)
    run(${WORK}/build/device_store ${WORK}/sphere.zarr)
  endif()
endif()

# The same library for those who build with pkg-config.
set(ENV{PKG_CONFIG_PATH} ${prefix}/lib/pkgconfig:${prefix}/${LIBDIR}/pkgconfig)
execute_process(COMMAND pkg-config --cflags --libs isobrick OUTPUT_VARIABLE flags
  OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
separate_arguments(flags)
separate_arguments(own_flags UNIX_COMMAND "${FLAGS}")
run(${COMPILER} ${PROJECT}/array.cpp -o ${WORK}/by_pkg_config ${own_flags} ${flags})
set(ENV{LD_LIBRARY_PATH} ${prefix}/${LIBDIR})
run(${WORK}/by_pkg_config)
unset(ENV{LD_LIBRARY_PATH})

# What the shared library shows, and by what name programs ask for it.
if(SHARED)
  set(library ${prefix}/${LIBDIR}/libisobrick.so)
  execute_process(COMMAND readelf -d ${library} OUTPUT_VARIABLE dynamic COMMAND_ERROR_IS_FATAL ANY)
  if(NOT dynamic MATCHES "SONAME.*libisobrick.so.[0-9]+.[0-9]+\\]")
    message(FATAL_ERROR "no SONAME with a version:\n${dynamic}")
  endif()
  execute_process(COMMAND nm -DC --defined-only ${library} OUTPUT_VARIABLE symbols
    COMMAND_ERROR_IS_FATAL ANY)
  string(REPLACE "\n" ";" symbols "${symbols}")
  list(FILTER symbols EXCLUDE REGEX
    " (isobrick::v0::|(vtable|typeinfo|typeinfo name) for isobrick::v0::)|^$")
  if(symbols)
    list(JOIN symbols "\n" symbols)
    message(FATAL_ERROR "symbols that are not the interface:\n${symbols}")
  endif()
endif()

# What draws requires libraries of windows, which are not found.
if(VIEWER)
  execute_process(COMMAND ${CMAKE_COMMAND} -DCOMPONENT=app ${WORK}/build RESULT_VARIABLE result
    ERROR_VARIABLE output OUTPUT_QUIET)
  if(result EQUAL 0 OR NOT output MATCHES "glm")
    message(FATAL_ERROR "the component app does not require glm: ${result} ${output}")
  endif()
endif()

# The program goes with its modules, wherever they are moved.
file(RENAME ${prefix} ${WORK}/moved)
run(${WORK}/moved/bin/isobrick synth sphere ${WORK}/a.zarr --dims 20,20,20 --type u8)
if("openvdb" IN_LIST MODULES)
  run(${WORK}/moved/bin/isobrick export ${WORK}/a.zarr ${WORK}/a.vdb)
endif()

# Modules of the build tree are not taken in place of those that have gone.
if(MODULES)
  execute_process(COMMAND ${WORK}/build/consumer ${WORK} ${MODULES} RESULT_VARIABLE result
    ERROR_VARIABLE output OUTPUT_QUIET)
  if(result EQUAL 0 OR NOT output MATCHES "install isobrick as a whole")
    message(FATAL_ERROR "a module that is not installed was loaded: ${result} ${output}")
  endif()
endif()
file(REMOVE_RECURSE ${WORK})
