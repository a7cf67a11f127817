# cmake --install build: the program, and the libraries for find_package(cohort). Headers go to
# include/cohort, which the targets name as include root: #include "frontend/track/tracker.h".
# The components are the packages of cmake/packages.cmake: program, development, python.
include(CMakePackageConfigHelpers)

get_property(libraries GLOBAL PROPERTY COHORT_INSTALLED_LIBRARIES)
install(TARGETS ${libraries} cohort_opencv EXPORT cohortTargets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}/cohort COMPONENT development
        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/cohort COMPONENT development)
# All that `cmake --install` and cpack take.
add_custom_target(installed)
add_dependencies(installed ${libraries})
if(COHORT_BUILD_PROGRAM)
  add_dependencies(installed cohort manual)
endif()
if(COHORT_BUILD_PYTHON)
  add_dependencies(installed cohort_python)
endif()
foreach(wing frontend backend datasets pipelines/sfm)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/${wing}/
          DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/cohort/${wing} COMPONENT development
          FILES_MATCHING PATTERN "*.h")
endforeach()
if(COHORT_BUILD_PROGRAM)
  install(TARGETS cohort RUNTIME COMPONENT program)
  set(written ${PROJECT_BINARY_DIR}/manual/share)
  install(DIRECTORY ${written}/man/ DESTINATION ${CMAKE_INSTALL_MANDIR} COMPONENT program)
  install(DIRECTORY ${written}/bash-completion ${written}/fish
          DESTINATION ${CMAKE_INSTALL_DATADIR} COMPONENT program)
  install(FILES ${PROJECT_SOURCE_DIR}/pipelines/blender/import_cohort.py
          DESTINATION ${CMAKE_INSTALL_DATADIR}/cohort/blender COMPONENT program)
  # Debian's zsh looks for what packages bring in a folder of its own.
  install(CODE "set(folder site-functions)
if(CMAKE_INSTALL_PREFIX MATCHES \"/usr$\")
  set(folder vendor-completions)
endif()
file(INSTALL \"${written}/zsh/_cohort\"
     DESTINATION \"\${CMAKE_INSTALL_PREFIX}/${CMAKE_INSTALL_DATADIR}/zsh/\${folder}\")"
          COMPONENT program)
endif()

set(package ${CMAKE_INSTALL_LIBDIR}/cmake/cohort)
install(EXPORT cohortTargets NAMESPACE cohort:: DESTINATION ${package} COMPONENT development)
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/cohortConfig.cmake.in
                              ${PROJECT_BINARY_DIR}/cohortConfig.cmake
                              INSTALL_DESTINATION ${package}
                              NO_SET_AND_CHECK_MACRO NO_CHECK_REQUIRED_COMPONENTS_MACRO)
write_basic_package_version_file(${PROJECT_BINARY_DIR}/cohortConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/cohortConfig.cmake
              ${PROJECT_BINARY_DIR}/cohortConfigVersion.cmake
        DESTINATION ${package} COMPONENT development)
