# Every library is declared by cohort_add_library, so that warnings, sanitizers and the include
# root are the same everywhere:
#   cohort_add_library(tracks SOURCES a.cc PUBLIC cohort::core PRIVATE SQLite::SQLite3
#                      PRECOMPILE <opencv2/core.hpp>)
# APART: sources that a unity build compiles alone: they share a name with another one, or are so large
# that GCC takes longer for them together.
# With INSTALL it is among those of cmake/install.cmake; so must be what it links of ours. LIGHT: it
# knows no Eigen, and no headers that are worth to be precompiled.
add_library(cohort_build_flags INTERFACE)
# Multiply-adds are not fused where the machine could (arm64): the same bytes on every one.
target_compile_options(cohort_build_flags INTERFACE -Wall -Wextra -ffp-contract=off)
if(CMAKE_UNITY_BUILD)
  # There a source is included, and GCC suspects that others may include its anonymous namespace, too.
  target_compile_options(cohort_build_flags INTERFACE $<$<CXX_COMPILER_ID:GNU>:-Wno-subobject-linkage>)
endif()
if(COHORT_WERROR)
  target_compile_options(cohort_build_flags INTERFACE -Werror)
endif()
if(COHORT_SANITIZE)
  # GCC 12's -Wmaybe-uninitialized sees ghosts in instrumented library code (std::regex).
  target_compile_options(cohort_build_flags INTERFACE -fsanitize=${COHORT_SANITIZE}
                         -fno-omit-frame-pointer -fno-sanitize-recover=all
                         $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  target_link_options(cohort_build_flags INTERFACE -fsanitize=${COHORT_SANITIZE})
endif()
if(COHORT_COVERAGE)
  target_link_options(cohort_build_flags INTERFACE -fprofile-instr-generate)
endif()

# OpenCV's imported targets carry no include directory; this one does.
add_library(cohort_opencv INTERFACE)
target_include_directories(cohort_opencv SYSTEM INTERFACE $<BUILD_INTERFACE:${OpenCV_INCLUDE_DIRS}>)
target_link_libraries(cohort_opencv INTERFACE ${OpenCV_LIBS})
set_target_properties(cohort_opencv PROPERTIES EXPORT_NAME opencv)

# Parsing the same headers is most of a build: where a target has many sources they are parsed once.
# Only headers of others; every file still includes what it uses.
function(cohort_precompile target)
  get_target_property(sources ${target} SOURCES)
  list(LENGTH sources count)
  if(NOT COHORT_PRECOMPILE OR count LESS 6)
    return()
  endif()
  target_precompile_headers(${target} PRIVATE
    <algorithm> <cmath> <filesystem> <functional> <map> <optional> <set> <span> <string> <vector>
    <fmt/format.h> <Eigen/Cholesky> <Eigen/Core> <Eigen/Eigenvalues> <Eigen/Geometry> <Eigen/LU> ${ARGN})
  # What ccache asks of GCC, beside its own sloppiness = pch_defines,time_macros.
  target_compile_options(${target} PRIVATE $<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
endfunction()

function(cohort_add_library name)
  cmake_parse_arguments(ARG "INSTALL;LIGHT" "" "SOURCES;APART;PUBLIC;PRIVATE;PRECOMPILE" ${ARGN})
  add_library(cohort_${name} STATIC ${ARG_SOURCES} ${ARG_APART})
  set_source_files_properties(${ARG_APART} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  add_library(cohort::${name} ALIAS cohort_${name})
  target_compile_features(cohort_${name} PUBLIC cxx_std_20)
  target_include_directories(cohort_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}>
    $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}/cohort>)
  target_link_libraries(cohort_${name} PUBLIC ${ARG_PUBLIC}
                        PRIVATE $<BUILD_INTERFACE:cohort_build_flags> ${ARG_PRIVATE})
  if(COHORT_COVERAGE)
    # By a relative path, the same for ccache in every folder.
    file(RELATIVE_PATH counted ${PROJECT_BINARY_DIR} ${PROJECT_SOURCE_DIR}/tests/coverage/counted.txt)
    target_compile_options(cohort_${name} PRIVATE -fprofile-instr-generate -fcoverage-mapping
                           -fprofile-list=${counted})
  endif()
  set_target_properties(cohort_${name} PROPERTIES EXPORT_NAME ${name})
  if(NOT ARG_LIGHT)
    cohort_precompile(cohort_${name} ${ARG_PRECOMPILE})
  endif()
  if(ARG_INSTALL)
    if(COHORT_BUILD_PYTHON)
      # For a shared object, at the speed of a program: calls within a library stay inlined.
      set_target_properties(cohort_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON)
      target_compile_options(cohort_${name} PRIVATE -fno-semantic-interposition)
    endif()
    set_property(GLOBAL APPEND PROPERTY COHORT_INSTALLED_LIBRARIES cohort_${name})
  endif()
endfunction()

# What cmake/list_suites.cmake lists after each build of the program.
function(cohort_list_suites program label timeout)
  set(list ${CMAKE_CURRENT_BINARY_DIR}/${program}_suites.cmake)
  add_custom_command(TARGET ${program} POST_BUILD VERBATIM BYPRODUCTS ${list}
    COMMAND ${CMAKE_COMMAND} -D PROGRAM=$<TARGET_FILE:${program}> -D LABEL=${label} -D TIMEOUT=${timeout}
            -D OUT=${list} -P ${PROJECT_SOURCE_DIR}/cmake/list_suites.cmake)
  file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/${program}_include.cmake
       "if(EXISTS [=[${list}]=])\n  include([=[${list}]=])\nelse()\n"
       "  add_test(${program}_NOT_BUILT ${program}_NOT_BUILT)\nendif()\n")
  set_property(DIRECTORY APPEND PROPERTY
               TEST_INCLUDE_FILES ${CMAKE_CURRENT_BINARY_DIR}/${program}_include.cmake)
endfunction()

# cohort_add_tests(tracks LABEL unit PARTS 2 SOURCES a_test.cc LIBRARIES cohort::tracks)
# One program a folder. A program that links OpenCV takes a third of a second to start, longer than most
# tests: CTest lists PARTS of it that run side by side, each with its share of the tests; with SUITES
# every suite of it by name, for tests that share what takes long to set up; without either every TEST.
# Under sanitizers there are two parts of what has no number. What the label `unit` needs is built by the
# target unit_tests.
function(cohort_add_tests name)
  cmake_parse_arguments(ARG "SUITES" "LABEL;PARTS;TIMEOUT" "SOURCES;APART;LIBRARIES" ${ARGN})
  if(NOT ARG_TIMEOUT)
    set(ARG_TIMEOUT 900)  # of what hangs: machines are slow at times
  endif()
  add_executable(${name}_test ${ARG_SOURCES} ${ARG_APART})
  set_source_files_properties(${ARG_APART} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
  target_link_libraries(${name}_test PRIVATE cohort_build_flags cohort_test_support ${ARG_LIBRARIES})
  # A test is compiled more often than it runs: half the time of -O3. What it calls is in libraries.
  target_compile_options(${name}_test PRIVATE -O1)
  cohort_precompile(${name}_test <gmock/gmock.h> <gtest/gtest.h>)
  if(ARG_LABEL STREQUAL unit)
    add_dependencies(unit_tests ${name}_test)
  endif()
  if(COHORT_SANITIZE)
    set(ARG_TIMEOUT 1800)
    if(NOT ARG_PARTS)
      set(ARG_PARTS 2)
    endif()
  endif()
  if(ARG_PARTS)
    foreach(part RANGE 1 ${ARG_PARTS})
      math(EXPR index "${part} - 1")
      set(environment GTEST_TOTAL_SHARDS=${ARG_PARTS} GTEST_SHARD_INDEX=${index})
      if(COHORT_COVERAGE)
        list(APPEND environment LLVM_PROFILE_FILE=${PROJECT_BINARY_DIR}/coverage/%m.profraw)
      endif()
      add_test(NAME ${name}.${part}_of_${ARG_PARTS} COMMAND ${name}_test)
      set_tests_properties(${name}.${part}_of_${ARG_PARTS} PROPERTIES
                           LABELS ${ARG_LABEL} TIMEOUT ${ARG_TIMEOUT} ENVIRONMENT "${environment}")
    endforeach()
  elseif(ARG_SUITES)
    cohort_list_suites(${name}_test ${ARG_LABEL} ${ARG_TIMEOUT})
  else()
    gtest_discover_tests(${name}_test PROPERTIES LABELS ${ARG_LABEL} TIMEOUT ${ARG_TIMEOUT}
                         DISCOVERY_TIMEOUT 60)
  endif()
endfunction()
