# The Python package is built for a Python that has NumPy and headers: the one that Python3_EXECUTABLE
# names, else the system's, else the first in PATH. pybind11 may be Debian's or that Python's own.
set(isobrick_python_candidates ${Python3_EXECUTABLE})
if(NOT isobrick_python_candidates)
  find_program(ISOBRICK_SYSTEM_PYTHON python3 PATHS /usr/bin NO_DEFAULT_PATH)
  find_program(isobrick_python_in_path python3 NO_CACHE)
  set(isobrick_python_candidates ${ISOBRICK_SYSTEM_PYTHON} ${isobrick_python_in_path})
endif()
set(isobrick_python_found OFF)
foreach(python IN LISTS isobrick_python_candidates)
  execute_process(COMMAND ${python} -c
    "import numpy, os, sysconfig; assert os.path.exists(sysconfig.get_path('include') + '/Python.h')"
    RESULT_VARIABLE result OUTPUT_QUIET ERROR_QUIET)
  if(result EQUAL 0)
    set(Python3_EXECUTABLE ${python})
    find_package(Python3 3.9 QUIET COMPONENTS Interpreter Development.Module)
    execute_process(COMMAND ${python} -m pybind11 --cmakedir OUTPUT_VARIABLE pybind11_folder
      OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    find_package(pybind11 2.10 QUIET HINTS ${pybind11_folder})
    if(Python3_FOUND AND pybind11_FOUND)
      set(isobrick_python_found ON)
      break()
    endif()
  endif()
endforeach()
isobrick_found_option(ISOBRICK_PYTHON "Build the Python package" ${isobrick_python_found}
  "a Python 3.9 with headers and NumPy, or pybind11 2.10," "no Python package")
