// The files of the web page, which are part of the program.
#pragma once

#include <span>
#include <string_view>

namespace isomesh::http {

struct PageFile {
  std::string_view path;  // as it is asked for: /, /assets/index-1a2b3c4d.js
  std::string_view type;
  std::string_view etag;  // without quotes
  bool immutable;         // its name holds its digest, so that it never changes
  std::string_view bytes;
  std::string_view gzip;  // the same compressed; empty when that does not pay
};

// All of them; a build without the page has one that says so at /. Thread safe.
std::span<const PageFile> page_files();

}  // namespace isomesh::http
