#include "server/codec/file_names.h"

#include <cstdint>
#include <cstdlib>
#include <memory>
#include <new>
#include <string_view>

#include <utf8proc.h>

#include "base/text.h"
#include "server/codec/label_titles.h"

namespace isomesh::codec {
namespace {

// Leaves room for the suffix and a distinguishing number.
constexpr std::size_t kMostBytes = 200;

// Equal for names that Windows or macOS take for one. Some others are equal, too, such as "ss" and
// a sharp s: a name with a number is better than a lost file.
std::string folded(const std::string& name) {
  constexpr auto kOptions = static_cast<utf8proc_option_t>(UTF8PROC_STABLE | UTF8PROC_COMPOSE |
                                                           UTF8PROC_CASEFOLD | UTF8PROC_IGNORE);
  utf8proc_uint8_t* text = nullptr;
  const auto length = utf8proc_map(reinterpret_cast<const utf8proc_uint8_t*>(name.data()),
                                   static_cast<utf8proc_ssize_t>(name.size()), &text, kOptions);
  if (length == UTF8PROC_ERROR_NOMEM) throw std::bad_alloc();
  if (length < 0) return lower(name);
  const std::unique_ptr<utf8proc_uint8_t, decltype(&std::free)> held(text, &std::free);
  return {reinterpret_cast<const char*>(text), static_cast<std::size_t>(length)};
}

// True for names that are devices on Windows, with or without a suffix.
bool is_device(const std::string& name) {
  const std::string stem = lower(name.substr(0, name.find('.')));
  const bool is_numbered = (stem.starts_with("com") || stem.starts_with("lpt")) &&
                           stem.size() == 4 && stem[3] >= '1' && stem[3] <= '9';
  return is_numbered || stem == "con" || stem == "prn" || stem == "aux" || stem == "nul";
}

}  // namespace

std::string FileNames::of(const LabelSummary& label) {
  std::string name;
  for (const char c : title_of(label)) {
    const bool is_plain = static_cast<unsigned char>(c) >= ' ' &&
                          std::string_view("/\\:*?\"<>|").find(c) == std::string_view::npos;
    name += is_plain ? c : '_';
  }
  name.resize(beginning(name, kMostBytes).size());
  while (!name.empty() && (name.back() == '.' || name.back() == ' ')) name.pop_back();
  if (name.starts_with('.') || name.empty() || is_device(name)) name.insert(name.begin(), '_');
  const std::string title = name;
  for (int more = 0; !taken_.insert(folded(name)).second; ++more) {
    name =
        title + '-' + std::to_string(label.label) + (more == 0 ? "" : '-' + std::to_string(more));
  }
  return name;
}

}  // namespace isomesh::codec
