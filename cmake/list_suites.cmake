# Lists the suites of a GoogleTest program for CTest, a process each: their tests share what takes long
# to set up. COST: they begin among the first, so that no processor waits for one of them at the end.
#   cmake -D PROGRAM=a_test -D LABEL=slow -D TIMEOUT=900 -D OUT=a_suites.cmake -P cmake/list_suites.cmake
execute_process(COMMAND "${PROGRAM}" --gtest_list_tests OUTPUT_VARIABLE list COMMAND_ERROR_IS_FATAL ANY)
# Names of suites begin a line and end in a dot; those of tests are indented.
string(REGEX MATCHALL "\n[^ \n]+\\." suites "\n${list}")
if(NOT suites)
  message(FATAL_ERROR "${PROGRAM} has no tests")
endif()
set(tests "")
foreach(suite IN LISTS suites)
  string(REGEX REPLACE "^\n|\\.$" "" suite "${suite}")
  string(APPEND tests "add_test([=[${suite}]=] [=[${PROGRAM}]=] [=[--gtest_filter=${suite}.*]=])\n"
                      "set_tests_properties([=[${suite}]=] PROPERTIES LABELS ${LABEL} TIMEOUT ${TIMEOUT} COST 100)\n")
endforeach()
file(WRITE "${OUT}" "${tests}")
