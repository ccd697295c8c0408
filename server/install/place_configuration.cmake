# Runs at the installation, which alone knows the prefix: `cmake --install --prefix` and CPack set others than the one that the
# build was configured with. Installs the configuration, and the unit, which has the paths of the program and of the configuration.
# What is installed in /usr has its configuration in /etc.
cmake_path(ABSOLUTE_PATH CMAKE_INSTALL_PREFIX NORMALIZE OUTPUT_VARIABLE isomesh_prefix)
if(isomesh_prefix STREQUAL "/usr" AND isomesh_sysconfdir STREQUAL "etc")
  set(isomesh_sysconfdir /etc)
endif()
cmake_path(ABSOLUTE_PATH isomesh_sysconfdir BASE_DIRECTORY ${isomesh_prefix} OUTPUT_VARIABLE ISOMESH_CONFIG)
cmake_path(APPEND ISOMESH_CONFIG isomesh)
cmake_path(ABSOLUTE_PATH isomesh_sbindir BASE_DIRECTORY ${isomesh_prefix} OUTPUT_VARIABLE ISOMESH_SBIN)
configure_file(${CMAKE_CURRENT_LIST_DIR}/isomeshd.service.in ${isomesh_made}/isomeshd.service @ONLY)
file(INSTALL ${isomesh_made}/isomeshd.toml DESTINATION ${ISOMESH_CONFIG})
file(INSTALL ${isomesh_made}/isomeshd.service DESTINATION ${isomesh_prefix}/lib/systemd/system)
