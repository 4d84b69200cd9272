# Pictures and the viewer are built where there are headers of what they use, and a
# font (DejaVu Sans, which becomes part of the program).
pkg_check_modules(epoxy QUIET IMPORTED_TARGET epoxy)
pkg_check_modules(imgui QUIET IMPORTED_TARGET imgui)
find_package(glm QUIET)
find_package(glfw3 QUIET)
find_path(ISOBRICK_STB_INCLUDE stb/stb_truetype.h)
find_file(ISOBRICK_FONT DejaVuSans.ttf PATHS /usr/share/fonts /usr/local/share/fonts
  PATH_SUFFIXES truetype/dejavu dejavu dejavu-sans-fonts TTF)
mark_as_advanced(ISOBRICK_STB_INCLUDE ISOBRICK_FONT)
if(epoxy_FOUND AND imgui_FOUND AND TARGET glm::glm AND TARGET glfw AND ISOBRICK_STB_INCLUDE
   AND ISOBRICK_FONT)
  set(isobrick_viewer_found ON)
else()
  set(isobrick_viewer_found OFF)
endif()
option(ISOBRICK_VIEWER "Draw pictures and show volumes with OpenGL" ${isobrick_viewer_found})
set(isobrick_viewer_needs "libepoxy, GLM, GLFW, Dear ImGui, stb or DejaVuSans.ttf")
if(ISOBRICK_VIEWER AND NOT isobrick_viewer_found)
  message(FATAL_ERROR "ISOBRICK_VIEWER is on, but ${isobrick_viewer_needs} was not found")
elseif(NOT ISOBRICK_VIEWER)
  message(STATUS "${isobrick_viewer_needs} not found, or turned off: no pictures, no viewer")
endif()
