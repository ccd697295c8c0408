#include "server/import/images/ome_meaning.h"

#include <algorithm>
#include <array>
#include <functional>
#include <iterator>
#include <map>
#include <string>
#include <vector>

#include "base/text.h"
#include "base/xml_reader.h"
#include "server/import/images/tiff_description.h"
#include "server/import/source/names.h"

namespace isomesh::import {
namespace {

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

class OmeDocument : public XmlHandler {
 public:
  // Throws XmlError.
  explicit OmeDocument(std::string_view text) { XmlReader(*this).read(text, true); }

  const std::string& file() const { return file_; }
  const std::vector<OmePixels>& pixels() const { return pixels_; }

 private:
  static std::string_view local(std::string_view name) { return name.substr(name.rfind(':') + 1); }

  void start_element(std::string_view full_name, const XmlAttributes& attributes) override {
    const std::string_view name = local(full_name);
    if (name == "OME") {
      is_ome_ = true;
      file_ = attributes.find("UUID").value_or("");
    } else if (name == "Pixels" && is_ome_) {
      attributes.for_each([&, &all = pixels_.emplace_back().attributes](
                              const char* key, const char* value) { all.emplace(key, value); });
    } else if (name == "TiffData" && !pixels_.empty()) {
      pixels_.back().data.push_back(tiff_data(attributes));
    }
    is_in_uuid_ = name == "UUID" && !pixels_.empty() && !pixels_.back().data.empty();
  }
  void end_element(std::string_view /*name*/) override { is_in_uuid_ = false; }
  void text(std::string_view part) override {
    if (is_in_uuid_) pixels_.back().data.back().file += trimmed(part);
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

  bool is_ome_ = false;
  bool is_in_uuid_ = false;
  std::string file_;
  std::vector<OmePixels> pixels_;
};

// Some programs write Latin-1 and call it UTF-8.
std::string from_latin_1(std::string_view text) {
  std::string result;
  for (const char letter : text) {
    const auto code = static_cast<unsigned char>(letter);
    if (code < 0x80) {
      result += letter;
    } else {
      result += static_cast<char>(0xC0U | (code >> 6U));
      result += static_cast<char>(0x80U | (code & 0x3FU));
    }
  }
  return result;
}

OmeDocument ome_document(std::string_view text) {
  try {
    return OmeDocument(text);
  } catch (const XmlError&) {
    try {
      return OmeDocument(from_latin_1(text));
    } catch (const XmlError& error) {
      throw_unusable("The OME-TIFF's description is damaged: " + printable(error.what()) + ".");
    }
  }
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

// https://docs.openmicroscopy.org/ome-model/latest/ome-tiff/specification.html#the-tiffdata-element
std::map<std::uint64_t, std::uint64_t> pages_of(const OmePixels& pixels, const TiffMeaning& meaning,
                                                const std::string& file, std::uint64_t pages) {
  const bool is_one_file = std::ranges::all_of(
      pixels.data, [&](const TiffData& data) { return data.file == pixels.data.front().file; });
  std::map<std::uint64_t, std::uint64_t> result;
  std::uint64_t work = 0;
  for (const TiffData& data : pixels.data) {
    const bool is_here = data.file.empty() || data.file == file || is_one_file;
    if (!is_here || data.slice >= meaning.slices || data.channel >= meaning.channels ||
        data.time >= meaning.times) {
      continue;
    }
    const std::uint64_t first = data.page.value_or(0);
    const std::uint64_t count = data.count.value_or(data.page ? 1 : pages);
    const std::uint64_t plane =
        meaning.plane_of(data.channel + meaning.channels * data.time, data.slice);
    const std::uint64_t planes = meaning.slices * meaning.channels * meaning.times;
    for (std::uint64_t at = 0;
         at < std::min(count, planes - plane) && first < pages && at < pages - first; ++at) {
      if (++work > kMostOfAKind) throw_unusable("The OME-TIFF's description names too many pages.");
      result[plane + at] = first + at;
    }
  }
  return result;
}

TiffMeaning ome_meaning(const OmePixels& pixels, const std::string& file, std::uint64_t pages) {
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
  meaning.page_of_plane = pages_of(pixels, meaning, file, pages);
  return meaning;
}

}  // namespace

std::optional<TiffMeaning> ome_meaning(std::string_view text, std::uint64_t pages) {
  if (!text.starts_with('<') || text.find("OME") == text.npos || text.find("Pixels") == text.npos) {
    return std::nullopt;
  }
  const OmeDocument document = ome_document(text);
  std::vector<TiffMeaning> all;
  for (OmePixels pixels : document.pixels()) {
    if (pixels.data.empty() && document.pixels().size() == 1) pixels.data.emplace_back();
    all.push_back(ome_meaning(pixels, document.file(), pages));
  }
  if (all.empty()) return std::nullopt;
  const auto is_elsewhere = [](const TiffMeaning& meaning) {
    return meaning.page_of_plane->empty();
  };
  const auto here = std::ranges::find_if_not(all, is_elsewhere);
  if (std::ranges::count_if(all, is_elsewhere) + 1 < std::ssize(all)) {
    throw_unusable("The OME-TIFF holds several images. Send each in a file of its own.");
  }
  return here == all.end() ? all.front() : *here;
}

}  // namespace isomesh::import
