# cmake -DSOURCE_DIR=... -DHEADER=... -P WriteCommit.cmake: the checked-out commit as a header, written when it changes.
cmake_minimum_required(VERSION 3.22)
execute_process(COMMAND git describe --always --dirty --exclude "*" WORKING_DIRECTORY ${SOURCE_DIR}
                OUTPUT_VARIABLE commit OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET RESULT_VARIABLE failed)
if(failed)
  set(commit "")
endif()
file(CONFIGURE OUTPUT ${HEADER} CONTENT "#define EDITNERF_COMMIT \"@commit@\"\n" @ONLY)
