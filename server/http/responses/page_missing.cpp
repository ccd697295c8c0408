// The page in a build without it (ISOMESH_WEB=OFF).
#include <array>

#include "server/http/responses/page.h"

namespace isomesh::http {

std::span<const PageFile> page_files() {
  static constexpr std::array<PageFile, 2> kFiles = {
      {{.path = "/",
        .type = "text/html; charset=utf-8",
        .etag = "missing",
        .immutable = false,
        .bytes = "<!doctype html>\n"
                 "<html lang=\"en\">\n"
                 "<title>isomesh</title>\n"
                 "<p>This isomeshd was built without its web page (ISOMESH_WEB=OFF).\n"
                 "<p>The API is described in <a href=\"/openapi.yaml\">/openapi.yaml</a>.\n",
        .gzip = ""},
       {.path = "/client.js",
        .type = "text/javascript; charset=utf-8",
        .etag = "missing",
        .immutable = false,
        .bytes = "throw new Error('This isomeshd was built without its JavaScript client "
                 "(ISOMESH_WEB=OFF).');\n",
        .gzip = ""}}};
  return kFiles;
}

}  // namespace isomesh::http
