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
isobrick_found_option(ISOBRICK_VIEWER "Draw pictures and show volumes with OpenGL"
  ${isobrick_viewer_found} "libepoxy, GLM, GLFW, Dear ImGui, stb or DejaVuSans.ttf"
  "no pictures, no viewer")
