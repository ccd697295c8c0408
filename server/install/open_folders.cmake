# The service must enter the folders of its package, also if the umask of whoever makes it lets nobody else in. CMake's variables
# for permissions of folders do not overrule the umask. CPack runs this when what goes into the packages lies ready.
execute_process(COMMAND find ${CPACK_TEMPORARY_DIRECTORY} -type d -exec chmod 755 {} + COMMAND_ERROR_IS_FATAL ANY)
