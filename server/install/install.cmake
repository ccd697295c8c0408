# The component daemon: programs, unit, configuration, manual page, completions.
install(TARGETS isomeshd RUNTIME DESTINATION ${CMAKE_INSTALL_SBINDIR} COMPONENT daemon)
install(TARGETS ${ISOMESH_DAEMON_PROGRAMS} RUNTIME DESTINATION ${CMAKE_INSTALL_LIBEXECDIR}/isomesh COMPONENT daemon)

set(made ${CMAKE_CURRENT_BINARY_DIR}/installed)
file(MAKE_DIRECTORY ${made})
# systemd makes the unit's data folder in /var/lib with every prefix.
isomesh_written(${made}/isomeshd.toml isomeshd --data /var/lib/isomesh config)
isomesh_written(${made}/isomeshd.8 isomeshd manual)
isomesh_written(${made}/isomeshd.bash isomeshd completion bash)
isomesh_written(${made}/_isomeshd isomeshd completion zsh)
isomesh_written(${made}/isomeshd.fish isomeshd completion fish)

install(CODE "
  set(isomesh_made [[${made}]])
  set(isomesh_sbindir [[${CMAKE_INSTALL_SBINDIR}]])
  set(isomesh_sysconfdir [[${CMAKE_INSTALL_SYSCONFDIR}]])" COMPONENT daemon)
install(SCRIPT ${CMAKE_CURRENT_LIST_DIR}/place_configuration.cmake COMPONENT daemon)
install(FILES ${CMAKE_CURRENT_LIST_DIR}/isomesh.sysusers RENAME isomesh.conf
  DESTINATION lib/sysusers.d COMPONENT daemon)
install(FILES ${made}/isomeshd.8 DESTINATION ${CMAKE_INSTALL_MANDIR}/man8 COMPONENT daemon)
install(FILES ${made}/isomeshd.bash RENAME isomeshd
  DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT daemon)
install(FILES ${made}/_isomeshd DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/vendor-completions COMPONENT daemon)
install(FILES ${made}/isomeshd.fish
  DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT daemon)
