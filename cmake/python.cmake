# COHORT_BUILD_PYTHON: the Python module cohort (pipelines/python), wherever what it needs is there:
# Debian's pybind11-dev, python3-dev and python3-numpy. By itself not inside another project, and
# not with sanitizers, which a Python without them cannot load.
set(Python_EXECUTABLE /usr/bin/python3 CACHE FILEPATH "The Python that the module cohort is for")
set(cohort_python_parts COMPONENTS Interpreter Development.Module NumPy)

set(COHORT_PYTHON_INSTALL_DIR lib/python3/dist-packages CACHE PATH "Where the Python module is installed")
if(NOT DEFINED COHORT_BUILD_PYTHON)
  set(found FALSE)
  if(PROJECT_IS_TOP_LEVEL AND NOT COHORT_SANITIZE)
    find_package(Python 3.9 QUIET ${cohort_python_parts})
    find_package(pybind11 2.10 QUIET)
    if(Python_FOUND AND pybind11_FOUND)
      set(found TRUE)
    else()
      message(STATUS "No Python module: pybind11-dev, python3-dev or python3-numpy is missing")
    endif()
  endif()
  set(COHORT_BUILD_PYTHON ${found} CACHE BOOL "Build the Python module cohort")
endif()
if(COHORT_BUILD_PYTHON)
  find_package(Python 3.9 REQUIRED ${cohort_python_parts})
  find_package(pybind11 2.10 REQUIRED)
endif()
