# cmake --install, and the package that find_package(editnerf) finds.
include(GNUInstallDirs)
include(CMakePackageConfigHelpers)
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/editnerf)
set(EDITNERF_TARGETS core)
if(EDITNERF_BUILD_TOOLS)
  list(APPEND EDITNERF_TARGETS tools)
endif()
install(TARGETS ${EDITNERF_TARGETS} EXPORT editnerf ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
install(EXPORT editnerf NAMESPACE editnerf:: DESTINATION ${package_dir} FILE editnerfTargets.cmake)
install(DIRECTORY libeditnerf/ DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/libeditnerf FILES_MATCHING PATTERN "*.h")
install(DIRECTORY configs/ DESTINATION ${CMAKE_INSTALL_DATADIR}/editnerf/configs)
configure_package_config_file(cmake/editnerfConfig.cmake.in ${CMAKE_BINARY_DIR}/editnerfConfig.cmake
                              INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${CMAKE_BINARY_DIR}/editnerfConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${CMAKE_BINARY_DIR}/editnerfConfig.cmake ${CMAKE_BINARY_DIR}/editnerfConfigVersion.cmake
        DESTINATION ${package_dir})
