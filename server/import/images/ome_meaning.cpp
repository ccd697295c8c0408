#include <algorithm>
#include <array>
#include <charconv>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "base/text.h"
#include "base/xml_reader.h"
#include "server/import/images/tiff_meaning.h"
#include "server/import/source/names.h"
#include "server/import/source/old_encodings.h"

namespace isomesh::import {
namespace {

constexpr std::size_t kMostImages = 100'000;

// One or more pages in a row, and the plane of the first of them.
struct TiffData {
  std::optional<std::uint64_t> page;
  std::optional<std::uint64_t> count;
  std::uint64_t slice = 0;
  std::uint64_t channel = 0;
  std::uint64_t time = 0;
  std::string file;  // its UUID; empty for the file that has the description
};

struct OmePixels {
  std::map<std::string, std::string, std::less<>> attributes;
  std::vector<TiffData> data;

  std::string_view attribute(std::string_view name) const {
    const auto found = attributes.find(name);
    return found == attributes.end() ? std::string_view{} : std::string_view(found->second);
  }
};

struct OmeDocument {
  std::string file;  // the UUID of the file that has the description
  std::vector<OmePixels> images;
};

std::string_view local(std::string_view name) { return name.substr(name.rfind(':') + 1); }

class OmeReader : public XmlHandler {
 public:
  // Throws XmlError.
  OmeDocument read(std::string_view text) {
    try {
      reader_.read(text, true);
    } catch (const XmlError&) {
      // Damage behind the images, as in annotations, takes nothing from them.
      const bool has_all = !document_.images.empty() && !is_in_pixels_ &&
                           text.find("Pixels", reader_.begin()) == text.npos;
      if (!has_all) throw;
    }
    return std::move(document_);
  }

 private:
  void start_element(std::string_view full_name, const XmlAttributes& attributes) override {
    const std::string_view name = local(full_name);
    std::vector<OmePixels>& images = document_.images;
    if (name == "OME") {
      document_.file = attributes.find("UUID").value_or("");
    } else if (name == "Pixels") {
      if (images.size() == kMostImages) throw_unusable("The OME-TIFF describes too many images.");
      is_in_pixels_ = true;
      attributes.for_each([&, &all = images.emplace_back().attributes](
                              const char* key, const char* value) { all.emplace(key, value); });
    } else if (name == "TiffData" && is_in_pixels_) {
      if (++data_ > kMostOfAKind) throw_unusable("The OME-TIFF's description is too long.");
      images.back().data.push_back(tiff_data(attributes));
    }
    is_in_uuid_ = name == "UUID" && is_in_pixels_ && !images.back().data.empty();
  }
  void end_element(std::string_view name) override {
    is_in_uuid_ = false;
    if (local(name) == "Pixels") is_in_pixels_ = false;
    if (local(name) == "OME") reader_.stop();
  }
  void text(std::string_view part) override {
    if (is_in_uuid_) document_.images.back().data.back().file += trimmed(part);
  }

  static TiffData tiff_data(const XmlAttributes& attributes) {
    const auto number = [&](std::string_view name) {
      return parse_uint64(attributes.find(name).value_or(""));
    };
    TiffData data;
    data.page = number("IFD");
    data.count = number("PlaneCount");
    if (!data.count) data.count = number("NumPlanes");  // its name before 2008
    data.slice = number("FirstZ").value_or(0);
    data.channel = number("FirstC").value_or(0);
    data.time = number("FirstT").value_or(0);
    return data;
  }

  XmlReader reader_{*this};
  bool is_in_pixels_ = false;
  bool is_in_uuid_ = false;
  std::uint64_t data_ = 0;
  OmeDocument document_;
};

bool begins_with_reference(std::string_view text) {
  for (const char* known : {"&amp;", "&lt;", "&gt;", "&quot;", "&apos;"}) {
    if (text.starts_with(known)) return true;
  }
  const bool is_hex = text.starts_with("&#x");
  if (!is_hex && !text.starts_with("&#")) return false;
  const std::string_view digits = text.substr(is_hex ? 3 : 2);
  std::uint32_t code = 0;
  const auto [end, error] = std::from_chars(digits.begin(), digits.end(), code, is_hex ? 16 : 10);
  return error == std::errc{} && end != digits.end() && *end == ';' && code >= ' ';
}

// Some programs write names as they are, with "&" and control characters.
std::string cleaned(std::string_view text) {
  std::string result;
  for (std::size_t at = 0; at < text.size(); ++at) {
    const bool is_control = static_cast<unsigned char>(text[at]) < ' ';
    result += is_control ? ' ' : text[at];
    if (text[at] == '&' && !begins_with_reference(text.substr(at))) result += "amp;";
  }
  return result;
}

// Some programs write Latin-1 and call it UTF-8.
std::string from_latin_1(std::string_view text) { return as_utf8(text, OldEncoding::kLatin1); }

OmeDocument ome_document(std::string text) {
  for (const auto repair : {&cleaned, &from_latin_1}) {
    try {
      return OmeReader().read(text);
    } catch (const XmlError&) {
      text = repair(text);
    }
  }
  try {
    return OmeReader().read(text);
  } catch (const XmlError& error) {
    throw_unusable("The OME-TIFF's description is damaged: " + printable(error.what()) + ".");
  }
}

// The text from its element OME on; empty without one. What is before it may be wrong: a byte-order
// mark, or an encoding in which the text was before it came into the file.
std::string_view ome_element(std::string_view text) {
  constexpr std::size_t kLongestName = 64;
  for (std::size_t at = text.find('<'); at != text.npos; at = text.find('<', at + 1)) {
    const std::string_view name = text.substr(at + 1, kLongestName);
    if (local(name.substr(0, name.find_first_of(" \t\r\n/>"))) == "OME") return text.substr(at);
  }
  return {};
}

[[noreturn]] void throw_several() {
  throw_unusable("The OME-TIFF holds several images. Send each in a file of its own.");
}

std::optional<std::array<double, 3>> ome_spacing(const OmePixels& pixels) {
  std::array<double, 3> spacing = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::string name = std::string("PhysicalSize") + "XYZ"[axis];
    const std::string_view unit = pixels.attribute(name + "Unit");
    const auto size = described_positive(pixels.attribute(name));
    const auto length = described_length(unit.empty() ? "um" : unit);
    if (!size || !length) return std::nullopt;
    spacing[axis] = *size * *length;
  }
  return spacing;
}

TiffMeaning ome_meaning(const OmePixels& pixels) {
  TiffMeaning meaning;
  const std::string_view order = pixels.attribute("DimensionOrder");
  std::string sorted(order);
  std::ranges::sort(sorted);
  if (sorted != "CTXYZ" || !order.starts_with("XY")) {
    throw_unusable("The DimensionOrder of the OME-TIFF, " + in_quotes(order) + ", is unknown.");
  }
  meaning.order = order;
  meaning.slices = described_count(pixels.attribute("SizeZ"), 1);
  meaning.channels = described_count(pixels.attribute("SizeC"), 1);
  meaning.times = described_count(pixels.attribute("SizeT"), 1);
  meaning.spacing = ome_spacing(pixels);
  return meaning;
}

std::uint64_t planes_of(const TiffMeaning& meaning) {
  return meaning.slices * meaning.channels * meaning.times;
}

// https://docs.openmicroscopy.org/ome-model/latest/ome-tiff/specification.html#the-tiffdata-element
std::map<std::uint64_t, std::uint64_t> pages_of(const OmePixels& pixels, const TiffMeaning& meaning,
                                                const std::string& file, std::uint64_t pages) {
  std::map<std::uint64_t, std::uint64_t> result;
  std::uint64_t work = 0;
  for (const TiffData& data : pixels.data) {
    const bool is_here = data.file.empty() || data.file == file;
    if (!is_here || data.slice >= meaning.slices || data.channel >= meaning.channels ||
        data.time >= meaning.times) {
      continue;
    }
    const std::uint64_t first = data.page.value_or(0);
    const std::uint64_t count = data.count.value_or(data.page ? 1 : pages);
    const std::uint64_t plane =
        meaning.plane_of(data.channel + meaning.channels * data.time, data.slice);
    for (std::uint64_t at = 0;
         at < std::min(count, planes_of(meaning) - plane) && first < pages && at < pages - first;
         ++at) {
      if (++work > kMostOfAKind) throw_unusable("The OME-TIFF's description names too many pages.");
      result[plane + at] = first + at;
    }
  }
  return result;
}

// The UUID by which TiffData names this file. A file that was given another one is the only one
// that is named, or the first that has as many pages as its image.
std::string own_file(const OmeDocument& document, std::uint64_t pages) {
  std::set<std::string_view> files;
  for (const OmePixels& pixels : document.images) {
    for (const TiffData& data : pixels.data) files.insert(data.file);
  }
  if (files.contains("") || files.contains(document.file)) return document.file;
  for (const OmePixels& pixels : document.images) {
    if (pixels.data.empty()) continue;
    const std::string& file = pixels.data.front().file;
    const bool is_one_file =
        std::ranges::all_of(pixels.data, [&](const TiffData& data) { return data.file == file; });
    if (files.size() == 1 || (is_one_file && planes_of(ome_meaning(pixels)) == pages)) return file;
  }
  return document.file;
}

// Without any TiffData, the pages are the planes of the image.
void complete(std::vector<OmePixels>& images, std::uint64_t pages) {
  OmePixels& first = images.front();
  const bool has_data =
      std::ranges::any_of(images, [](const OmePixels& pixels) { return !pixels.data.empty(); });
  if (!has_data && (images.size() == 1 || planes_of(ome_meaning(first)) == pages)) {
    first.data.emplace_back();
  } else if (!has_data) {
    throw_several();
  }
}

}  // namespace

std::optional<TiffMeaning> ome_meaning(std::string_view text, std::uint64_t pages) {
  text = ome_element(text);
  if (text.find("Pixels") == text.npos) return std::nullopt;
  OmeDocument document = ome_document(std::string(text));
  if (document.images.empty()) return std::nullopt;
  complete(document.images, pages);
  const std::string file = own_file(document, pages);
  std::optional<TiffMeaning> found;
  for (const OmePixels& pixels : document.images) {
    TiffMeaning meaning = ome_meaning(pixels);
    meaning.page_of_plane = pages_of(pixels, meaning, file, pages);
    const bool is_here = !meaning.page_of_plane->empty();
    if (found && is_here && !found->page_of_plane->empty()) throw_several();
    if (!found || is_here) found = std::move(meaning);
  }
  return found;
}

}  // namespace isomesh::import
