# How every dependency is found. Lowest versions and licences: third_party/README.md.
# Nothing is vendored and nothing is downloaded.
set(THREADS_PREFER_PTHREAD_FLAG ON)
find_package(Threads REQUIRED)
find_package(Torch 1.13 REQUIRED)
# LibTorch's package sets global flags for its ABI; the rest of it arrives with the target.
if(TORCH_CXX_FLAGS)
  set(CMAKE_CXX_FLAGS "${CMAKE_CXX_FLAGS} ${TORCH_CXX_FLAGS}")
endif()
find_package(yaml-cpp 0.6 REQUIRED)
if(NOT TARGET yaml-cpp::yaml-cpp)  # before 0.8 the target has no namespace
  add_library(yaml-cpp::yaml-cpp INTERFACE IMPORTED)
  target_link_libraries(yaml-cpp::yaml-cpp INTERFACE yaml-cpp)
endif()
find_package(fmt 8 REQUIRED)
find_package(spdlog 1.9 REQUIRED)
find_package(nlohmann_json 3.9 REQUIRED)
find_package(hwy 1.0.3 REQUIRED)

if(EDITNERF_BUILD_TOOLS)
  find_package(OpenCV 4.5 REQUIRED COMPONENTS core imgproc imgcodecs videoio video)
  find_package(Ceres 2.0 REQUIRED)
  find_package(CLI11 2.1 REQUIRED)
  # cpp-httplib, for enf-edit alone. Debian's is a library whose header needs the same definitions; elsewhere it is one
  # header.
  find_package(PkgConfig QUIET)
  if(PkgConfig_FOUND)
    pkg_check_modules(HTTPLIB QUIET IMPORTED_TARGET cpp-httplib>=0.11)
  endif()
  find_path(HTTPLIB_INCLUDE_DIR httplib.h)
  if(HTTPLIB_FOUND)
    add_library(editnerf_httplib INTERFACE)
    target_link_libraries(editnerf_httplib INTERFACE PkgConfig::HTTPLIB)
  elseif(HTTPLIB_INCLUDE_DIR)
    add_library(editnerf_httplib INTERFACE)
    target_include_directories(editnerf_httplib SYSTEM INTERFACE ${HTTPLIB_INCLUDE_DIR})
    target_link_libraries(editnerf_httplib INTERFACE Threads::Threads)
  else()
    message(WARNING "cpp-httplib was not found: enf-edit, the browser editor, is not built. "
                    "Install libcpp-httplib-dev and pkgconf, or set HTTPLIB_INCLUDE_DIR to the folder of httplib.h")
  endif()
endif()

if(EDITNERF_BUILD_TESTS)
  find_package(Catch2 REQUIRED)
  add_library(editnerf_catch2 INTERFACE)
  target_link_libraries(editnerf_catch2 INTERFACE Catch2::Catch2)
  include(Catch)
endif()
