#include "server/http/oidc/strict_json.h"

#include <set>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/error.h"
#include "proto/json_text.h"

namespace isomesh::oidc {
namespace {

constexpr std::size_t kDeepest = 16;

// Called by the parser for each part of a document.
class Watch {
 public:
  bool operator()(Json::parse_event_t event, const Json& value) {
    if (event == Json::parse_event_t::object_start) {
      names_.emplace_back();
    } else if (event == Json::parse_event_t::object_end) {
      names_.pop_back();
    } else if (event == Json::parse_event_t::array_start) {
      ++arrays_;
    } else if (event == Json::parse_event_t::array_end) {
      --arrays_;
    } else if (event == Json::parse_event_t::key) {
      if (!names_.back().insert(value.get<std::string>()).second) {
        throw Error(ErrorCode::kInvalidParameter, "has two members of one name");
      }
    }
    if (names_.size() + arrays_ > kDeepest) {
      throw Error(ErrorCode::kInvalidParameter, "is nested too deep");
    }
    return true;
  }

 private:
  std::vector<std::set<std::string>> names_;  // of the open objects' members
  std::size_t arrays_ = 0;
};

}  // namespace

JsonTree strict_object(std::string_view text) {
  Watch watch;
  JsonTree tree;
  const Json::parser_callback_t watching = [&](int /*depth*/, Json::parse_event_t event,
                                               const Json& value) { return watch(event, value); };
  tree.root() = parse_json<Json>(text, watching, false);
  if (!tree.root().is_object()) throw Error(ErrorCode::kInvalidParameter, "is no JSON object");
  return tree;
}

std::string text_of(const Json& object, std::string_view name) {
  const Json* member = json_values::find(object, name);
  return member == nullptr || !json_values::is_string(*member) ? "" : json_values::text(*member);
}

}  // namespace isomesh::oidc
