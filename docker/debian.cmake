# CPack makes the Debian packages isomeshd, isomesh and libisomesh-dev, whatever prefix the build was configured with. Their
# dependencies are read from the binaries.
set(ISOMESH_MAINTAINER "isomesh <isomesh@localhost>" CACHE STRING "Maintainer of the packages: NAME <ADDRESS>")
string(TIMESTAMP ISOMESH_BUILT "%a, %d %b %Y %H:%M:%S +0000" UTC)
set(changelog ${PROJECT_BINARY_DIR}/changelog)
configure_file(${PROJECT_SOURCE_DIR}/server/install/changelog.in ${changelog} @ONLY)
execute_process(COMMAND gzip --best --no-name --keep --force ${changelog} COMMAND_ERROR_IS_FATAL ANY)
foreach(pair daemon:isomeshd client:isomesh dev:libisomesh-dev)
  string(REPLACE ":" ";" pair ${pair})
  list(GET pair 0 component)
  list(GET pair 1 package)
  install(FILES ${PROJECT_SOURCE_DIR}/server/install/copyright
    DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} COMPONENT ${component})
  install(FILES ${changelog}.gz DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package} RENAME changelog.Debian.gz
    COMPONENT ${component})
  string(TOUPPER ${component} upper)
  set(CPACK_DEBIAN_${upper}_PACKAGE_NAME ${package})
endforeach()
# For administrators. The folders are those of the sources, so links in the texts stay right.
set(doc ${CMAKE_INSTALL_DATADIR}/doc/isomeshd)
file(GLOB texts CONFIGURE_DEPENDS ${PROJECT_SOURCE_DIR}/docs/*.md)
install(FILES ${texts} DESTINATION ${doc}/docs COMPONENT daemon)
install(FILES ${PROJECT_SOURCE_DIR}/README.md ${PROJECT_SOURCE_DIR}/SECURITY.md DESTINATION ${doc} COMPONENT daemon)
foreach(file hospital.toml nginx.conf upstream.conf alerts.yml dashboard.json)
  install(FILES ${PROJECT_SOURCE_DIR}/docker/${file} DESTINATION ${doc}/docker COMPONENT daemon)
endforeach()

include(${PROJECT_SOURCE_DIR}/server/install/sbom.cmake)

set(CPACK_GENERATOR DEB)
set(CPACK_COMPONENTS_ALL daemon client dev)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_SET_DESTDIR ON)
set(CPACK_INSTALL_PREFIX /usr)
set(CPACK_STRIP_FILES ON)
set(CPACK_PACKAGE_NAME isomesh)
set(CPACK_PACKAGE_VENDOR isomesh)
set(CPACK_PACKAGE_CONTACT ${ISOMESH_MAINTAINER})
set(CPACK_PRE_BUILD_SCRIPTS
  ${PROJECT_SOURCE_DIR}/server/install/compress_manuals.cmake ${PROJECT_SOURCE_DIR}/server/install/open_folders.cmake)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_PACKAGE_RELEASE 1 CACHE STRING "Revision of the packages")
set(CPACK_DEBIAN_PACKAGE_SHLIBDEPS ON)

set(scripts ${PROJECT_SOURCE_DIR}/server/install)
set(CPACK_DEBIAN_DAEMON_PACKAGE_SECTION science)
set(CPACK_DEBIAN_DAEMON_PACKAGE_DEPENDS "adduser")
set(CPACK_DEBIAN_DAEMON_PACKAGE_CONTROL_EXTRA
  ${scripts}/postinst ${scripts}/prerm ${scripts}/postrm ${scripts}/conffiles)
set(CPACK_COMPONENT_DAEMON_DESCRIPTION
  "daemon that turns medical volumes into surface meshes\nisomeshd has an HTTP API and a web page. It reads DICOM, NIfTI, NRRD,\nMetaImage, VTK, TIFF and other files, ZIP and TAR archives of them, and raw\nsamples. It extracts and\nsmooths the surfaces of iso-values and labels, and writes Draco, GLB, STL, PLY,\nOBJ, 3MF, OFF, VTK, VTP and GIFTI files.\nThe package contains isomeshd and the programs that it runs: isomesh-import\nreads uploads, isomesh-job makes meshes, and isomesh-dimse sends and receives\nDICOM objects. isomesh-verify checks a mesh against its volume.")

set(CPACK_DEBIAN_CLIENT_PACKAGE_SECTION science)
set(CPACK_DEBIAN_CLIENT_PACKAGE_SUGGESTS isomeshd)
set(CPACK_COMPONENT_CLIENT_DESCRIPTION
  "command that turns medical volumes into surface meshes\nisomesh uploads a volume to an isomesh daemon, starts a job and downloads the\nmesh, in one step or in several. It takes DICOM, NIfTI, NRRD, MetaImage, VTK, TIFF\nand other files and folders, and saves Draco, GLB, STL, PLY, OBJ, 3MF, OFF, VTK, VTP and\nGIFTI files. With the package isomeshd it also works without a server.")

set(CPACK_DEBIAN_DEV_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEV_PACKAGE_DEPENDS "libcurl4-openssl-dev | libcurl4-gnutls-dev, libssl-dev")
set(CPACK_COMPONENT_DEV_DESCRIPTION
  "C++ library for clients of isomesh daemons\nPrograms upload volumes, start jobs and download meshes with it. The package\ncontains headers, static libraries, and files for CMake and pkg-config.")
include(CPack)
