// The files of the web page, compiled into the program.
#pragma once

#include <span>
#include <string_view>

namespace isomesh::http {

struct PageFile {
  std::string_view path;  // in requests: /, /assets/index-1a2b3c4d.js
  std::string_view type;
  std::string_view etag;  // without quotes
  bool immutable;         // its name contains its digest, so it never changes
  std::string_view bytes;
  std::string_view gzip;  // compressed; empty if that saves nothing
};

// All files; a build without the page has only / with a message. Thread safe.
std::span<const PageFile> page_files();

}  // namespace isomesh::http
