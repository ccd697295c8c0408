# cmake -D FOLDER=.. -P npm.cmake: npm for a machine that has Node without it, as FOLDER/package/bin/npm-cli.js. The registry is
# that of npm's own variable.
set(version 10.9.4)  # of the last line that runs on Node 18
set(hash 3a7506f37e85c1ba1021baad79f0cd9724748131f321fc117c4dc3ba235ec01be7327584a41d15117c01945560aa9373220628fcc1e1dddd877a5fe9b336a900)
# npm has this address built in; here is no npm to ask.
set(registry https://registry.npmjs.org)
if(NOT "$ENV{npm_config_registry}" STREQUAL "")
  string(REGEX REPLACE "/+$" "" registry "$ENV{npm_config_registry}")
endif()

set(address ${registry}/npm/-/npm-${version}.tgz)
set(file ${FOLDER}/npm.tgz)
file(DOWNLOAD ${address} ${file} TLS_VERIFY ON STATUS status)
list(POP_FRONT status code reason)
if(NOT code EQUAL 0)
  message(FATAL_ERROR "${address} cannot be downloaded: ${reason}. Install npm, or name a registry in npm_config_registry.")
endif()
file(SHA512 ${file} found)
if(NOT found STREQUAL hash)
  message(FATAL_ERROR "${address} is not npm ${version}: its SHA-512 is ${found}.")
endif()
file(ARCHIVE_EXTRACT INPUT ${file} DESTINATION ${FOLDER} TOUCH)
