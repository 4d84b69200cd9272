# Pictures and the viewer are built where there are headers of what they use, and a
# font (DejaVu Sans, which becomes part of the program).
pkg_check_modules(epoxy QUIET IMPORTED_TARGET epoxy)
find_package(glm QUIET)
find_path(ISOBRICK_STB_INCLUDE stb/stb_truetype.h)
find_file(ISOBRICK_FONT DejaVuSans.ttf PATHS /usr/share/fonts /usr/local/share/fonts
  PATH_SUFFIXES truetype/dejavu dejavu TTF)
mark_as_advanced(ISOBRICK_STB_INCLUDE ISOBRICK_FONT)
if(epoxy_FOUND AND TARGET glm::glm AND ISOBRICK_STB_INCLUDE AND ISOBRICK_FONT)
  set(isobrick_viewer_found ON)
else()
  set(isobrick_viewer_found OFF)
endif()
option(ISOBRICK_VIEWER "Draw pictures and show volumes with OpenGL" ${isobrick_viewer_found})
if(ISOBRICK_VIEWER AND NOT isobrick_viewer_found)
  message(FATAL_ERROR "ISOBRICK_VIEWER is on, but libepoxy, GLM, stb or DejaVuSans.ttf was not found")
elseif(NOT ISOBRICK_VIEWER)
  message(STATUS "libepoxy, GLM, stb or DejaVuSans.ttf not found, or turned off: no pictures, no viewer")
endif()
