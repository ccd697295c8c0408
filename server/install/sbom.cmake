# What each component is made of, for what, and the licences of others in it, beside its documents. Told by ninja, so it is
# made when a build is installed; on other systems than Debian there is none.
find_program(ISOMESH_DPKG_QUERY dpkg-query)
find_program(ISOMESH_PYTHON3 python3)
if(NOT ISOMESH_DPKG_QUERY OR NOT ISOMESH_PYTHON3 OR NOT CMAKE_GENERATOR STREQUAL "Ninja")
  message(STATUS "No SBOM: that takes Debian, Ninja and python3.")
  return()
endif()

# isomesh_sbom(COMPONENT PACKAGE [PAGE] TARGET..): PAGE where the component has the page.
function(isomesh_sbom component package)
  set(targets ${ARGN})
  set(page)
  list(REMOVE_ITEM targets PAGE)
  if("PAGE" IN_LIST ARGN AND ISOMESH_WEB)
    set(page "--page \"${PROJECT_BINARY_DIR}/client/web/third_party.json\"")
  endif()
  list(JOIN targets " " targets)
  set(into ${PROJECT_BINARY_DIR}/sbom/${package})
  install(CODE "execute_process(COMMAND \"${ISOMESH_PYTHON3}\" \"${PROJECT_SOURCE_DIR}/server/install/sbom\"
    --build \"${PROJECT_BINARY_DIR}\" ${page} --version ${PROJECT_VERSION} --into \"${into}\" ${package} ${targets}
    COMMAND_ERROR_IS_FATAL ANY)" COMPONENT ${component})
  set(soup ${into}/soup.md)
  if(component STREQUAL "dev")
    set(soup)  # only programs isolate what is in them
  endif()
  install(FILES ${into}/sbom.cdx.json ${into}/third-party-licenses.gz ${soup}
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component})
endfunction()

if(ISOMESH_DAEMON)
  get_property(programs GLOBAL PROPERTY ISOMESH_DAEMON_PROGRAMS)
  list(TRANSFORM programs PREPEND bin/)
  isomesh_sbom(daemon isomeshd PAGE bin/isomeshd ${programs})
endif()
if(ISOMESH_COMMAND)
  isomesh_sbom(client isomesh bin/isomesh)
endif()
isomesh_sbom(dev libisomesh-dev base/libisomesh_base.a proto/libisomesh_proto.a server/hospital/client/libisomesh_order_client.a server/hospital/protocol/libisomesh_order_protocol.a client/isomesh/libisomesh_client.a)
