# cpack --config build/CPackConfig.cmake: Debian packages of what is built, whose dependencies
# dpkg-shlibdeps finds (Debian's dpkg-dev):
#   cohort          the program, its manual and completions
#   libcohort-dev   the libraries, which are static, for find_package(cohort)
#   python3-cohort  the Python module
# cmake --build build --target source_archive: build/cohort-VERSION.tar.gz, what the last commit holds
# and the bundled report pages, so that it is built without node and npm.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_CONTACT "The cohort authors")
set(CPACK_COMPONENTS_ALL development)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PACKAGE_SECTION science)
set(CPACK_STRIP_FILES ON)

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libcohort-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION
    "The libraries, which are static, with their headers, for find_package(cohort).")
# What cohortConfig.cmake looks for.
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS
    "libeigen3-dev, libopencv-dev, libopencv-contrib-dev, libceres-dev, libsqlite3-dev, libzip-dev, \
libavformat-dev, libavcodec-dev, libavfilter-dev, libavutil-dev, libswscale-dev, pkgconf, \
libfmt-dev, libspdlog-dev")
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SUGGESTS nlohmann-json3-dev)
install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/libcohort-dev
        RENAME copyright COMPONENT development)

if(COHORT_BUILD_PROGRAM)
  list(APPEND CPACK_COMPONENTS_ALL program)
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME cohort)
  set(CPACK_COMPONENT_PROGRAM_DESCRIPTION
      "The program: tracks feature points through video, all of them together, and makes\n\
cameras and points of the tracks.")
  set(CPACK_DEBIAN_PROGRAM_PACKAGE_RECOMMENDS "colmap, ffmpeg")
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/cohort
          RENAME copyright COMPONENT program)
endif()

if(COHORT_BUILD_PYTHON)
  list(APPEND CPACK_COMPONENTS_ALL python)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-cohort)
  set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
  set(CPACK_COMPONENT_PYTHON_DESCRIPTION "The Python module cohort.")
  # A module is for one version of Python.
  math(EXPR next_minor "${Python_VERSION_MINOR} + 1")
  set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS
      "python3 (>= 3.${Python_VERSION_MINOR}), python3 (<< 3.${next_minor}), python3-numpy")
  install(FILES ${PROJECT_SOURCE_DIR}/LICENSE DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/python3-cohort
          RENAME copyright COMPONENT python)
endif()
include(CPack)

if(COHORT_BUILD_PROGRAM AND NOT COHORT_BUNDLED_PAGES)
  set(archive cohort-${PROJECT_VERSION})
  add_custom_target(source_archive
    COMMAND git archive --output ${PROJECT_BINARY_DIR}/${archive}.tar.gz
            --prefix ${archive}/pipelines/report/page/bundled/
            --add-file ${PROJECT_BINARY_DIR}/report_page/report_page.cc
            --add-file ${PROJECT_BINARY_DIR}/report_page/clip_page.cc
            --prefix ${archive}/ HEAD
    DEPENDS ${PROJECT_BINARY_DIR}/report_page/report_page.cc
            ${PROJECT_BINARY_DIR}/report_page/clip_page.cc
    WORKING_DIRECTORY ${PROJECT_SOURCE_DIR}
    COMMENT "Writing ${archive}.tar.gz"
    VERBATIM)
endif()
