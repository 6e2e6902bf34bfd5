# One function each to add a library part, a program and a test program.
include(CheckCXXCompilerFlag)
# ccache helps with GCC; with Clang it would hash a precompiled header of 125 MB for every file, slower than compiling.
if(NOT CMAKE_CXX_COMPILER_ID MATCHES "Clang")
  find_program(EDITNERF_CCACHE ccache)
  if(EDITNERF_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
    set(CMAKE_CXX_COMPILER_LAUNCHER ${EDITNERF_CCACHE})
  endif()
endif()

function(editnerf_set_common target)
  target_compile_options(${target} PRIVATE -Wall -Wextra)
  if(EDITNERF_WARNINGS_AS_ERRORS)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
  if(EDITNERF_SANITIZE)
    # What is found ends the program: a report that scrolls by would fail no test.
    target_compile_options(${target} PUBLIC -fsanitize=${EDITNERF_SANITIZE} -fno-sanitize-recover=all
                                            -fno-omit-frame-pointer)
    target_link_options(${target} PUBLIC -fsanitize=${EDITNERF_SANITIZE})
  endif()
endfunction()

# Precompiled headers pay with Clang alone: a file that uses LibTorch takes 1.5 s with one and 10 s without. GCC's save a
# third of the time and cost 600 MB for each target. Not torch/torch.h: its modules and data sets are compiled anew in
# every file that sees them, for two seconds, and the library needs few of them.
function(editnerf_precompile target)
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    target_precompile_headers(${target} PRIVATE
      <torch/types.h> <torch/autograd.h> <torch/nn/module.h> <torch/utils.h> <fmt/format.h> ${ARGN})
  endif()
endfunction()

# editnerf_add_library(NAME FLOORS base config ... [PUBLIC libs] [PRIVATE libs])
# All sources of the named folders below libeditnerf/, compiled with one precompiled header.
function(editnerf_add_library name)
  cmake_parse_arguments(ARG "" "" "FLOORS;PUBLIC;PRIVATE" ${ARGN})
  set(sources)
  foreach(floor IN LISTS ARG_FLOORS)
    file(GLOB_RECURSE floor_sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${floor}/*.cpp)
    list(APPEND sources ${floor_sources})
  endforeach()
  add_library(${name} STATIC ${sources})
  add_library(editnerf::${name} ALIAS ${name})
  set_target_properties(${name} PROPERTIES OUTPUT_NAME editnerf_${name})
  target_include_directories(${name} PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}> $<INSTALL_INTERFACE:include>)
  target_compile_features(${name} PUBLIC cxx_std_17)
  target_link_libraries(${name} PUBLIC ${ARG_PUBLIC} PRIVATE ${ARG_PRIVATE})
  editnerf_precompile(${name})
  editnerf_set_common(${name})
endfunction()

# editnerf_add_app(enf-train): apps/enf_train.cpp becomes the program enf-train.
function(editnerf_add_app name)
  string(REPLACE "-" "_" source ${name})
  add_executable(${name} ${source}.cpp)
  target_link_libraries(${name} PRIVATE app_support)
  if(CMAKE_CXX_COMPILER_ID MATCHES "Clang")
    # -fPIC, as the library whose precompiled header it shares; by default programs get -fPIE, and Clang refuses to mix.
    set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
    target_compile_options(${name} PRIVATE -fPIC)
    target_precompile_headers(${name} REUSE_FROM app_support)
  endif()
  editnerf_set_common(${name})
  install(TARGETS ${name} RUNTIME)
endfunction()

# editnerf_add_tests(NAME FLOORS base ... LINK editnerf::core): tests/FLOOR/*_test.cpp, registered with ctest.
function(editnerf_add_tests name)
  cmake_parse_arguments(ARG "" "" "FLOORS;LINK" ${ARGN})
  set(sources)
  foreach(floor IN LISTS ARG_FLOORS)
    file(GLOB floor_sources CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/${floor}/*.cpp)
    list(APPEND sources ${floor_sources})
  endforeach()
  add_executable(${name} main.cpp ${sources})
  target_link_libraries(${name} PRIVATE ${ARG_LINK} editnerf_catch2)
  editnerf_precompile(${name} ${CMAKE_CURRENT_SOURCE_DIR}/catch.h)
  set_source_files_properties(main.cpp PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
  target_compile_definitions(${name} PRIVATE
    EDITNERF_SOURCE_DIR="${PROJECT_SOURCE_DIR}"
    EDITNERF_BINARY_DIR="${PROJECT_BINARY_DIR}")
  editnerf_set_common(${name})
  # Idle threads of LibTorch's pools must not spin (apps/support/thread_pools.h). Catch2's script takes no lists.
  catch_discover_tests(${name} PROPERTIES LABELS ${name} TIMEOUT 900
    ENVIRONMENT GOMP_SPINCOUNT=1000 ENVIRONMENT_MODIFICATION OPENBLAS_THREAD_TIMEOUT=set:12)
endfunction()
