#include "server/http/responses/page.h"

#include <algorithm>

#include "server/http/requests/request_values.h"
#include "server/http/responses/sources.h"
#include "server/http/routes/routes.h"

namespace isomesh::http {
namespace {

// No foreign resources, no inline script or style, no framing. WebAssembly is the mesh decoder;
// blob: images are slices fetched with the token.
constexpr const char* kContentSecurityPolicy =
    "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; "
    "style-src 'self'; img-src 'self' blob:; connect-src 'self'; base-uri 'none'; "
    "form-action 'none'; frame-ancestors 'none'";

const PageFile* find_file(std::string_view path) {
  const std::span<const PageFile> files = page_files();
  const auto found = std::ranges::find(files, path, &PageFile::path);
  return found == files.end() ? nullptr : &*found;
}

void answer_file(const Request& request, Response& response) {
  const PageFile* file = find_file(request.path);
  if (file == nullptr) throw Error(ErrorCode::kNotFound, "there is nothing at this path");
  const bool zipped = !file->gzip.empty() && accepts_gzip(request);
  const std::string etag = '"' + std::string(file->etag) + (zipped ? "-gzip\"" : "\"");
  response.set_header("ETag", etag);
  response.add_header("Vary", "Accept-Encoding");
  response.set_header("Cache-Control",
                      file->immutable ? "public, max-age=31536000, immutable" : "no-cache");
  response.set_header("Content-Security-Policy", kContentSecurityPolicy);
  response.set_header("Cross-Origin-Opener-Policy", "same-origin");
  response.set_header("Referrer-Policy", "no-referrer");
  if (matches_etag(request, etag)) {
    response.status = 304;
    return;
  }
  if (zipped) response.set_header("Content-Encoding", "gzip");
  const std::string_view bytes = zipped ? file->gzip : file->bytes;
  // Streamed, because a plain body would be compressed again.
  response.stream = {.source = text_source(bytes),
                     .media_type = std::string(file->type),
                     .framing = Framing::kLength,
                     .length = bytes.size()};
}

}  // namespace

void add_page_routes(App& app) {
  add_get(app, "/", answer_file);
  add_get(app, "/assets/{file}", answer_file);
  add_get(app, "/client.js", answer_file);
}

}  // namespace isomesh::http
