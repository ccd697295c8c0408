# Copies the libraries that LIBRARY is linked with to the folder TO, except those that every Linux with Python has: the C and C++
# libraries, and the loader.
# The library looks there first, and would find what an earlier build has left.
file(REMOVE_RECURSE ${TO})
file(GET_RUNTIME_DEPENDENCIES RESOLVED_DEPENDENCIES_VAR found UNRESOLVED_DEPENDENCIES_VAR missing LIBRARIES ${LIBRARY}
  PRE_EXCLUDE_REGEXES "^lib(c|m|dl|rt|pthread|gcc_s|stdc[+][+])[.]so" "^ld-linux")
if(missing)
  message(FATAL_ERROR "These libraries of ${LIBRARY} are missing: ${missing}")
endif()
file(MAKE_DIRECTORY ${TO})
foreach(library IN LISTS found)
  get_filename_component(name ${library} NAME)
  file(REAL_PATH ${library} real)
  configure_file(${real} ${TO}/${name} COPYONLY)
endforeach()
