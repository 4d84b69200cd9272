# Libraries, headers, the program with its man page and completions, and packages:
# find_package(isobrick) then isobrick::isobrick, isobrick::pipeline, …, and pkg-config isobrick.
include(CMakePackageConfigHelpers)

set(isobrick_package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/isobrick)

get_property(libraries GLOBAL PROPERTY isobrick_libraries)
if(BUILD_SHARED_LIBS)
  list(APPEND libraries isobrick_isobrick)
endif()
install(TARGETS ${libraries} EXPORT isobrick_targets
  ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR} LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(DIRECTORY include/isobrick DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
install(EXPORT isobrick_targets NAMESPACE isobrick:: DESTINATION ${isobrick_package_dir})

# The CUDA runtime that the libraries were built with, so that programs of others need no toolkit.
if(ISOBRICK_CUDA)
  get_target_property(cudart CUDA::cudart_static IMPORTED_LOCATION)
  install(FILES ${cudart} DESTINATION ${CMAKE_INSTALL_LIBDIR}/isobrick)
endif()
string(REPLACE "isobrick_" "" isobrick_components "${libraries}")

configure_package_config_file(cmake/isobrick-config.cmake.in
  ${PROJECT_BINARY_DIR}/isobrick-config.cmake INSTALL_DESTINATION ${isobrick_package_dir}
  PATH_VARS CMAKE_INSTALL_LIBDIR)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/isobrick-config-version.cmake
  COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/isobrick-config.cmake
  ${PROJECT_BINARY_DIR}/isobrick-config-version.cmake DESTINATION ${isobrick_package_dir})

include(cmake/pkg_config.cmake)

if(ISOBRICK_BUILD_TOOLS)
  install(TARGETS isobrick RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
  install(FILES ${PROJECT_BINARY_DIR}/share/isobrick.1 DESTINATION ${CMAKE_INSTALL_MANDIR}/man1)
  install(FILES ${PROJECT_BINARY_DIR}/share/isobrick.bash RENAME isobrick
    DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions)
  install(FILES ${PROJECT_BINARY_DIR}/share/_isobrick
    DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions)
  install(FILES ${PROJECT_BINARY_DIR}/share/isobrick.fish
    DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d)
endif()
install(FILES LICENSE NOTICE README.md CHANGELOG.md DESTINATION ${CMAKE_INSTALL_DOCDIR})
