#include "server/store/s3/response_text.h"

#include <algorithm>
#include <utility>

#include "base/text.h"
#include "base/xml_reader.h"

namespace isomesh::store {
namespace {

class Leaves : public XmlHandler {
 public:
  explicit Leaves(S3Text& target) : target_(target) {}

  void start_element(std::string_view name, const XmlAttributes& /*attributes*/) override {
    if (path_.empty()) target_.root = name;
    path_.emplace_back(name);
    text_.clear();
    is_leaf_ = true;
  }

  void end_element(std::string_view /*name*/) override {
    std::string name = std::move(path_.back());
    path_.pop_back();
    if (is_leaf_) {
      target_.leaves.push_back({path_.empty() ? "" : path_.back(), std::move(name), text_});
    }
    is_leaf_ = false;
  }

  void text(std::string_view part) override { text_ += part; }

 private:
  S3Text& target_;
  std::vector<std::string> path_;
  std::string text_;
  bool is_leaf_ = false;
};

}  // namespace

std::string_view S3Text::find(std::string_view name) const {
  const auto found = std::ranges::find(leaves, name, &Leaf::name);
  return found == leaves.end() ? std::string_view() : found->text;
}

S3Text read_s3_text(std::string_view body) {
  S3Text text;
  try {
    Leaves leaves(text);
    XmlReader(leaves).read(body, true);
  } catch (const XmlError&) {
    return {};
  }
  return text;
}

std::string s3_error_code(std::string_view body) {
  const S3Text text = read_s3_text(body);
  constexpr std::size_t kLongest = 60;
  return text.root == "Error" ? printable(beginning(text.find("Code"), kLongest)) : "";
}

}  // namespace isomesh::store
