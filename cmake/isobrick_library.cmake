# isobrick::isobrick is what <isobrick/isobrick.h> declares: with BUILD_SHARED_LIBS one library that
# shows only that, else the static libraries of the folders.
option(BUILD_SHARED_LIBS "isobrick::isobrick is one shared library" OFF)
if(NOT BUILD_SHARED_LIBS)
  isobrick_interface(isobrick LINK isobrick::pipeline isobrick::meshes isobrick::filters)
  return()
endif()

set(isobrick_parts core index surface bytes http volumes meshes filters bricks stream pipeline)
foreach(part vtk gpu)
  if(TARGET isobrick_${part})
    list(APPEND isobrick_parts ${part})
  endif()
endforeach()
add_library(isobrick_isobrick SHARED)
add_library(isobrick::isobrick ALIAS isobrick_isobrick)
foreach(part IN LISTS isobrick_parts)
  target_sources(isobrick_isobrick PRIVATE $<TARGET_OBJECTS:isobrick_${part}>)
  # For what that part links; its objects are there already.
  target_link_libraries(isobrick_isobrick PRIVATE isobrick_${part})
endforeach()
# Below version 1 every minor version has an interface of its own.
set_target_properties(isobrick_isobrick PROPERTIES
  EXPORT_NAME isobrick OUTPUT_NAME isobrick LINKER_LANGUAGE CXX
  VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR}
  LIBRARY_OUTPUT_DIRECTORY ${PROJECT_BINARY_DIR}/${CMAKE_INSTALL_LIBDIR}
  INSTALL_RPATH $ORIGIN/isobrick)  # the modules of formats
target_include_directories(isobrick_isobrick INTERFACE
  $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/include> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
target_compile_features(isobrick_isobrick INTERFACE cxx_std_20)
set(isobrick_map ${PROJECT_SOURCE_DIR}/cmake/isobrick.map)
target_link_options(isobrick_isobrick PRIVATE LINKER:--version-script=${isobrick_map} LINKER:--no-undefined)
set_target_properties(isobrick_isobrick PROPERTIES LINK_DEPENDS ${isobrick_map})
