#include "server/codec/decode/xml_elements.h"

#include <algorithm>

#include "base/xml_reader.h"

namespace isomesh::codec::decoding {
namespace {

class Parser : public XmlHandler {
 public:
  Parser(MeshFormat format, std::string_view last) : format_(format), last_(last) {}

  std::vector<XmlElement> parse(Bytes file, const mesh::Context& context) {
    constexpr std::size_t kMostBytes = std::size_t{1} << 20;
    do {
      context.throw_if_stopped();
      const Bytes next = file.first(std::min(file.size(), kMostBytes));
      file = file.subspan(next.size());
      try {
        reader_.read({reinterpret_cast<const char*>(next.data()), next.size()}, file.empty());
      } catch (const XmlError& error) {
        refuse(format_, "it is not valid XML: " + std::string(error.what()));
      }
    } while (!file.empty() && !reader_.is_stopped());
    return std::move(elements_);
  }

 private:
  void start_element(std::string_view name, const XmlAttributes& pairs) override {
    constexpr std::size_t kMostElements = 1000;
    if (elements_.size() == kMostElements) refuse(format_, "it has more than 1000 elements");
    XmlElement& element = elements_.emplace_back();
    element.path = (open_.empty() ? "" : elements_[open_.back()].path + '/') + std::string(name);
    pairs.for_each(
        [&](const char* key, const char* value) { element.attributes.emplace(key, value); });
    element.begin = reader_.end();
    open_.push_back(elements_.size() - 1);
    if (name == last_) reader_.stop();
  }

  void end_element(std::string_view) override {
    elements_[open_.back()].end = reader_.begin();
    open_.pop_back();
  }

  const MeshFormat format_;
  const std::string_view last_;
  std::vector<XmlElement> elements_;
  std::vector<std::size_t> open_;
  XmlReader reader_{*this};
};

}  // namespace

std::string_view XmlElement::attribute(std::string_view name, MeshFormat format) const {
  const auto found = attributes.find(name);
  if (found == attributes.end()) {
    refuse(format, "an element has no attribute \"" + std::string(name) + '"');
  }
  return found->second;
}

std::vector<XmlElement> elements_of(Bytes file, MeshFormat format, std::string_view last,
                                    const mesh::Context& context) {
  return Parser(format, last).parse(file, context);
}

}  // namespace isomesh::codec::decoding
