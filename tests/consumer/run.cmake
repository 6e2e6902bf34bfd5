# Installs the build into a fresh prefix, then configures, builds and runs the consumer against it.
#   cmake -DBUILD_DIR=... -DSOURCE_DIR=... -DCXX=... -DGENERATOR=... -DTORCH_DIR=... -P run.cmake
set(work ${BUILD_DIR}/consumer)
file(REMOVE_RECURSE ${work})
file(MAKE_DIRECTORY ${work})

function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE code OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT code EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\nended with ${code}:\n${output}")
  endif()
endfunction()

run(${CMAKE_COMMAND} --install ${BUILD_DIR} --prefix ${work}/prefix)
run(${CMAKE_COMMAND} -S ${SOURCE_DIR}/tests/consumer -B ${work}/build -G ${GENERATOR} -DCMAKE_BUILD_TYPE=Release
    -DCMAKE_CXX_COMPILER=${CXX} -DCMAKE_PREFIX_PATH=${work}/prefix -DTorch_DIR=${TORCH_DIR})
run(${CMAKE_COMMAND} --build ${work}/build)
run(${work}/build/consumer make ${work}/run)
run(${work}/build/consumer ${work}/run ${work}/edited.ppm)
file(SIZE ${work}/edited.ppm size)
if(NOT size EQUAL 1741)  # "P6 32 18 255" and 32 x 18 pixels of three bytes
  message(FATAL_ERROR "edited.ppm has ${size} bytes, expected 1741")
endif()
foreach(name fast paper tiny)
  if(NOT EXISTS ${work}/prefix/share/editnerf/configs/${name}.yaml)
    message(FATAL_ERROR "share/editnerf/configs/${name}.yaml is not installed")
  endif()
endforeach()
