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

# An option that is on where its library was found; on without it is an error.
macro(isobrick_found_option option text found library without)
  option(${option} "${text}" ${found})
  if(${option} AND NOT "${found}")
    message(FATAL_ERROR "${option} is on, but ${library} was not found")
  elseif(NOT ${option})
    message(STATUS "${library} not found or turned off: ${without}")
  endif()
endmacro()

isobrick_format_library(ISOBRICK_EXPAT EXPAT "VTK images (.vti) and meshes (.vtp)")
isobrick_format_library(ISOBRICK_TIFF TIFF "TIFF stacks" 4.5)

# CMake's own module for HDF5 needs a C compiler; Debian calls the library that
# is not for MPI hdf5-serial.
pkg_search_module(hdf5 QUIET IMPORTED_TARGET hdf5-serial hdf5)
option(ISOBRICK_HDF5 "Read HDF5 datasets" ${hdf5_FOUND})
if(ISOBRICK_HDF5)
  pkg_search_module(hdf5 REQUIRED IMPORTED_TARGET hdf5-serial hdf5)
else()
  message(STATUS "HDF5 not found or turned off: HDF5 datasets cannot be read")
endif()

# DCMTK's packages of CMake and pkg-config need more than Debian's libdcmtk-dev has.
set(isobrick_dcmtk dcmjpls dcmjpeg dcmdata oflog ofstd)
find_path(ISOBRICK_DCMTK_INCLUDE dcmtk/dcmdata/dctk.h)
find_library(ISOBRICK_DCMTK_LIBRARY dcmdata)
mark_as_advanced(ISOBRICK_DCMTK_INCLUDE ISOBRICK_DCMTK_LIBRARY)
set(dcmtk_found OFF)
if(ISOBRICK_DCMTK_INCLUDE AND ISOBRICK_DCMTK_LIBRARY)
  set(dcmtk_found ON)
endif()
isobrick_found_option(ISOBRICK_DICOM "Read DICOM series" ${dcmtk_found} "DCMTK"
  "DICOM series cannot be read")

# Codecs that only Zarr of other programs has.
macro(isobrick_codec_library option module package)
  pkg_check_modules(${module} QUIET IMPORTED_TARGET ${package})
  isobrick_found_option(${option} "Read Zarr compressed by ${module}" "${${module}_FOUND}" ${package}
    "Zarr compressed by it cannot be read")
endmacro()
isobrick_codec_library(ISOBRICK_BLOSC blosc blosc)
isobrick_codec_library(ISOBRICK_LZ4 lz4 liblz4)

# OpenVDB's own module for CMake needs all that the library is made with.
find_path(ISOBRICK_OPENVDB_INCLUDE openvdb/openvdb.h)
find_library(ISOBRICK_OPENVDB_LIBRARY openvdb)
# Its headers call what it may have been built with for 16-bit floats.
find_library(ISOBRICK_IMATH_LIBRARY NAMES Imath Imath-3_1)
# They include Boost's, which Debian's package only recommends.
find_path(ISOBRICK_BOOST_INCLUDE boost/numeric/conversion/conversion_traits.hpp)
mark_as_advanced(ISOBRICK_OPENVDB_INCLUDE ISOBRICK_OPENVDB_LIBRARY ISOBRICK_IMATH_LIBRARY
                 ISOBRICK_BOOST_INCLUDE)
set(isobrick_openvdb_found OFF)
if(ISOBRICK_OPENVDB_INCLUDE AND ISOBRICK_OPENVDB_LIBRARY AND ISOBRICK_BOOST_INCLUDE)
  set(isobrick_openvdb_found ON)
endif()
isobrick_found_option(ISOBRICK_OPENVDB "Read and write OpenVDB grids" ${isobrick_openvdb_found}
  "OpenVDB with Boost's headers" ".vdb files cannot be read or written")
set(isobrick_openvdb_libraries ${ISOBRICK_OPENVDB_LIBRARY})
if(ISOBRICK_IMATH_LIBRARY)
  list(APPEND isobrick_openvdb_libraries ${ISOBRICK_IMATH_LIBRARY})
endif()

# Meshes with levels of detail.
pkg_check_modules(draco QUIET IMPORTED_TARGET draco)
isobrick_found_option(ISOBRICK_DRACO "Write neuroglancer's meshes" "${draco_FOUND}" Draco
  "neuroglancer's meshes cannot be written")

# Compressed GLB.
find_package(meshoptimizer QUIET)
isobrick_found_option(ISOBRICK_MESHOPT "Write and read compressed GLB" "${meshoptimizer_FOUND}" meshoptimizer
  "GLB cannot be compressed")

# Stores behind URLs. 7.85 has the options by name of protocols.
find_package(CURL 7.85 QUIET)
isobrick_found_option(ISOBRICK_CURL "Read stores from URLs" "${CURL_FOUND}" libcurl
  "stores behind URLs cannot be read")
