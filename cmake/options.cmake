option(ISOBRICK_BUILD_TOOLS "Build the isobrick program" ${PROJECT_IS_TOP_LEVEL})
option(ISOBRICK_BUILD_TESTS "Build the tests" ${PROJECT_IS_TOP_LEVEL})
option(ISOBRICK_BUILD_BENCH "Build the benchmarks" OFF)
option(ISOBRICK_WERROR "Warnings are errors" OFF)
set(ISOBRICK_SANITIZE "" CACHE STRING "Sanitizers, as -fsanitize takes them (address,undefined or thread)")

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "" FORCE)
endif()

set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_OPTIMIZE_DEPENDENCIES ON)  # files of a library compile before the libraries that it links
set(CMAKE_RUNTIME_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/bin)

# Only libraries that are really called: loading libhwy costs 5 ms, and optimised
# programs need nothing but its headers.
add_link_options(LINKER:--as-needed)

# Every library and program of ours: warnings, and floating point exactly as
# written (no contraction into fma), so that every machine makes the same mesh.
add_library(isobrick_flags INTERFACE)
# Private headers are named from here: "core/cancel.h".
target_include_directories(isobrick_flags INTERFACE ${PROJECT_SOURCE_DIR})
set(isobrick_warnings -Wall -Wextra -Wpedantic -Wconversion -Wshadow
  -Wno-missing-field-initializers)  # designated initialisers leave out what keeps its default
target_compile_options(isobrick_flags INTERFACE
  $<$<COMPILE_LANGUAGE:CXX>:${isobrick_warnings}
  -ffp-contract=off $<$<BOOL:${ISOBRICK_WERROR}>:-Werror>>)
if(CMAKE_UNITY_BUILD)  # g++ takes the files that a unity source includes for headers
  target_compile_options(isobrick_flags INTERFACE $<$<COMPILE_LANG_AND_ID:CXX,GNU>:-Wno-subobject-linkage>)
endif()
if(ISOBRICK_SANITIZE)
  target_compile_options(isobrick_flags INTERFACE -fsanitize=${ISOBRICK_SANITIZE} -fno-omit-frame-pointer)
  target_link_options(isobrick_flags INTERFACE -fsanitize=${ISOBRICK_SANITIZE})
endif()

# What nearly every source includes of others is read once: a build from nothing takes an eighth less.
# Off where it must show which sources forget an #include.
option(ISOBRICK_PRECOMPILED_HEADERS "Precompile the headers of other libraries" OFF)
function(isobrick_precompiled target)
  if(ISOBRICK_PRECOMPILED_HEADERS AND NOT target STREQUAL isobrick_core)
    target_link_libraries(${target} PRIVATE fmt::fmt)  # whose macros must be those of the headers
    target_precompile_headers(${target} REUSE_FROM isobrick_core)
  endif()
endfunction()

# isobrick_alone(source …): sources whose local names are also another file's. Unity builds
# (scripts/test, architecture.tidy.*) compile them as files of their own.
function(isobrick_alone)
  set_source_files_properties(${ARGN} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# isobrick_interface(name LINK …): isobrick::name stands for several libraries.
function(isobrick_interface name)
  cmake_parse_arguments(arg "" "" "LINK" ${ARGN})
  add_library(isobrick_${name} INTERFACE)
  add_library(isobrick::${name} ALIAS isobrick_${name})
  set_target_properties(isobrick_${name} PROPERTIES EXPORT_NAME ${name})
  target_link_libraries(isobrick_${name} INTERFACE ${arg_LINK})
  set_property(GLOBAL APPEND PROPERTY isobrick_libraries isobrick_${name})
endfunction()

# isobrick_library(name SOURCES … LINK … PRIVATE …): one folder, one target
# isobrick::name. LINK is public: it is the folder's row in the dependency table.
function(isobrick_library name)
  cmake_parse_arguments(arg "" "" "SOURCES;LINK;PRIVATE" ${ARGN})
  add_library(isobrick_${name} STATIC ${arg_SOURCES})
  add_library(isobrick::${name} ALIAS isobrick_${name})
  # Only what ISOBRICK_API marks leaves the shared library.
  set_target_properties(isobrick_${name} PROPERTIES EXPORT_NAME ${name}
    CXX_VISIBILITY_PRESET hidden CUDA_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON)
  target_include_directories(isobrick_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_compile_features(isobrick_${name} PUBLIC cxx_std_20)
  target_link_libraries(isobrick_${name} PUBLIC ${arg_LINK}
    PRIVATE ${arg_PRIVATE} $<BUILD_INTERFACE:isobrick_flags>)
  isobrick_precompiled(isobrick_${name})
  set_property(GLOBAL APPEND PROPERTY isobrick_libraries isobrick_${name})
endfunction()

# Libraries that take longer to link than most commands take are in modules of their own, loaded
# when they are needed (io/bytes/module.h): isobrick_module(name SOURCES … LINK … INCLUDE …).
# The target isobrick_modules is all of them, for what loads some.
add_custom_target(isobrick_modules)
function(isobrick_module name)
  cmake_parse_arguments(arg "" "" "SOURCES;LINK;INCLUDE" ${ARGN})
  set(target isobrick_${name})
  set(folder ${CMAKE_INSTALL_LIBDIR}/isobrick)
  add_library(${target} MODULE ${arg_SOURCES})
  set_target_properties(${target} PROPERTIES PREFIX ""
    LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/${folder})
  target_compile_definitions(${target} PRIVATE ISOBRICK_VERSION="${PROJECT_VERSION}")
  target_include_directories(${target} PRIVATE ${PROJECT_SOURCE_DIR})
  target_include_directories(${target} SYSTEM PRIVATE ${arg_INCLUDE})
  target_link_libraries(${target} PRIVATE isobrick_core isobrick_flags fmt::fmt TBB::tbb ${arg_LINK})
  add_dependencies(isobrick_modules ${target})
  install(TARGETS ${target} LIBRARY DESTINATION ${folder})
endfunction()
