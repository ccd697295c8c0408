#include "server/http/requests/request.h"

#include <algorithm>

#include "base/text.h"

namespace isomesh::http {
namespace {

const std::string* find(const Parameters& parameters, std::string_view name) {
  const auto found = std::ranges::find(parameters, name, &Parameters::value_type::first);
  return found == parameters.end() ? nullptr : &found->second;
}

std::string_view text_of(const std::string* value) {
  return value == nullptr ? std::string_view() : *value;
}

}  // namespace

bool Request::has_header(std::string_view name) const {
  return net::find_header(headers, name) != nullptr;
}

std::string_view Request::header(std::string_view name) const {
  return text_of(net::find_header(headers, name));
}

std::size_t Request::count_headers(std::string_view name) const {
  return static_cast<std::size_t>(std::ranges::count_if(
      headers, [&](const auto& header) { return net::equal_names(header.first, name); }));
}

bool Request::has_parameter(std::string_view name) const { return find(query, name) != nullptr; }

std::string_view Request::parameter(std::string_view name) const {
  return text_of(find(query, name));
}

std::size_t Request::count_parameters(std::string_view name) const {
  return static_cast<std::size_t>(std::ranges::count(query, name, &Parameters::value_type::first));
}

std::string Request::path_parameter(std::string_view name) const {
  return std::string(text_of(find(path_parameters, name)));
}

bool Request::is_form() const {
  return net::equal_names(split(header("Content-Type"), ';').front(), "multipart/form-data");
}

}  // namespace isomesh::http
