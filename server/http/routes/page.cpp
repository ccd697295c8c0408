#include "server/http/responses/page.h"

#include <algorithm>
#include <optional>
#include <string>

#include "proto/json_values.h"
#include "server/http/requests/request_values.h"
#include "server/http/responses/sources.h"
#include "server/http/routes/routes.h"

namespace isomesh::http {
namespace {

// No foreign resources but the login provider, no inline script or style, no framing. WebAssembly
// is the mesh decoder; blob: images are slices fetched with the token. A login exchanges its code
// with the provider.
std::string content_security_policy(const App& app) {
  const oidc::Provider* provider = app.logins.provider;
  const std::string login = provider == nullptr ? "" : provider->page_origin();
  return "default-src 'none'; script-src 'self' 'wasm-unsafe-eval'; worker-src 'self'; "
         "style-src 'self'; img-src 'self' blob:; connect-src 'self'" +
         (login.empty() ? "" : ' ' + login) +
         "; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
}

const PageFile* find_file(std::string_view path) {
  const std::span<const PageFile> files = page_files();
  const auto found = std::ranges::find(files, path, &PageFile::path);
  return found == files.end() ? nullptr : &*found;
}

void answer_file(const App& app, const Request& request, Response& response) {
  const PageFile* file = find_file(request.path);
  if (file == nullptr) throw Error(ErrorCode::kNotFound, "there is nothing at this path");
  const bool zipped = !file->gzip.empty() && accepts_gzip(request);
  const std::string etag = '"' + std::string(file->etag) + (zipped ? "-gzip\"" : "\"");
  response.set_header("ETag", etag);
  response.add_header("Vary", "Accept-Encoding");
  response.set_header("Cache-Control",
                      file->immutable ? "public, max-age=31536000, immutable" : "no-cache");
  response.set_header("Content-Security-Policy", content_security_policy(app));
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

void write_provider(Json& place, const oidc::PageLogin& login) {
  using json_values::write_field;
  json_values::make_object(place);
  write_field(place, "issuer", login.issuer);
  write_field(place, "client_id", login.client_id);
  write_field(place, "authorization_endpoint", login.authorization_endpoint);
  write_field(place, "token_endpoint", login.token_endpoint);
  write_field(place, "token", std::string(login.uses_id_token ? "id_token" : "access_token"));
  Json& parameters = json_values::member(place, "parameters");
  json_values::make_object(parameters);
  for (const auto& [name, value] : login.parameters) write_field(parameters, name.c_str(), value);
}

// How the page logs a person in.
void answer_login(const App& app, Response& response) {
  const oidc::Provider* provider = app.logins.provider;
  const auto login = provider == nullptr ? std::nullopt : provider->page_login();
  JsonTree answer;
  json_values::write_field(answer.root(), "tokens", app.logins.tokens != nullptr);
  Json& place = json_values::member(answer.root(), "provider");
  if (login) write_provider(place, *login);
  response.set_header("Cache-Control", "no-store");
  response.set_body(dump(answer.root()), "application/json");
}

}  // namespace

void add_page_routes(App& app) {
  const auto answer_with_file = [&app](const Request& request, Response& response) {
    answer_file(app, request, response);
  };
  add_get(app, "/", answer_with_file);
  add_get(app, "/assets/{file}", answer_with_file);
  add_get(app, "/client.js", answer_with_file);
  add_get(app, "/login", [&app](const Request& request, Response& response) {
    check_known(request, {});
    answer_login(app, response);
  });
}

}  // namespace isomesh::http
