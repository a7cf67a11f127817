# COHORT_BUILD_PYTHON: the Python module cohort (pipelines/python), wherever what it needs is there:
# Debian's pybind11-dev, python3-dev and python3-numpy. By itself not inside another project, and
# not with sanitizers, which a Python without them cannot load.
set(COHORT_PYTHON_INSTALL_DIR lib/python3/dist-packages CACHE STRING
    "Where the Python module is installed, below the prefix")
set(cohort_python_parts COMPONENTS Interpreter Development.Module NumPy)
if(PROJECT_IS_TOP_LEVEL OR COHORT_BUILD_PYTHON)
  set(Python_EXECUTABLE /usr/bin/python3 CACHE FILEPATH "The Python that the module cohort is for")
endif()
# Not in the cache: what is missing today may be installed tomorrow.
if(NOT DEFINED COHORT_BUILD_PYTHON)
  set(COHORT_BUILD_PYTHON FALSE)
  if(PROJECT_IS_TOP_LEVEL AND NOT COHORT_SANITIZE)
    find_package(Python 3.9 QUIET ${cohort_python_parts})
    find_package(pybind11 2.10 QUIET)
    if(Python_FOUND AND pybind11_FOUND)
      set(COHORT_BUILD_PYTHON TRUE)
    else()
      message(STATUS "No Python module: pybind11-dev, python3-dev or python3-numpy is missing")
    endif()
  endif()
endif()
if(COHORT_BUILD_PYTHON)
  find_package(Python 3.9 REQUIRED ${cohort_python_parts})
  find_package(pybind11 2.10 REQUIRED)
endif()
