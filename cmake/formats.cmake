# Libraries of volume formats. Each is optional: where one is not found (or is
# turned off) its format is recognised and refused.
macro(isobrick_format_library option package format)
  find_package(${package} ${ARGN} QUIET)
  option(${option} "Read ${format}" ${${package}_FOUND})
  if(${option})
    find_package(${package} ${ARGN} REQUIRED)
  else()
    message(STATUS "${package} not found or turned off: ${format} cannot be read")
  endif()
endmacro()

isobrick_format_library(ISOBRICK_EXPAT EXPAT "VTK images (.vti)")
isobrick_format_library(ISOBRICK_TIFF TIFF "TIFF stacks" 4.5)
