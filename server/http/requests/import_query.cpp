#include "server/http/requests/import_query.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <limits>

#include "base/text.h"
#include "server/http/limits.h"
#include "server/http/requests/request_values.h"
#include "server/volume/names.h"

namespace isomesh::http {
namespace {

const std::set<std::string>& raw_parameters() {
  static const std::set<std::string> names = {"dims",   "type",      "spacing",
                                              "origin", "direction", "byte_order"};
  return names;
}

// Parameters that select within a file; raw samples have nothing to select.
const std::set<std::string>& file_parameters() {
  static const std::set<std::string> names = {"series", "member", "masks",
                                              "volume", "accept", "nifti_form"};
  return names;
}

template <std::size_t N>
std::array<double, N> array_of(const std::string& name, std::string_view text) {
  std::array<double, N> numbers = {};
  std::ranges::copy(numbers_of(name, text, N), numbers.begin());
  return numbers;
}

std::array<std::uint32_t, 3> dims_of(std::string_view text) {
  const std::vector<std::string_view> parts = split(text, ',');
  std::array<std::uint32_t, 3> dims = {};
  const Error wrong = invalid_parameter(
      "dims", "must be 3 whole numbers from 1 to 4294967295, separated by commas");
  if (parts.size() != dims.size()) throw wrong;
  for (std::size_t i = 0; i < dims.size(); ++i) {
    const auto number = whole_number(parts[i]);
    if (!number || *number > std::numeric_limits<std::uint32_t>::max()) throw wrong;
    dims[i] = static_cast<std::uint32_t>(*number);
  }
  return dims;
}

std::string series_of(std::string_view text) {
  if (text.empty() || text.size() > limits::kLongestUid ||
      text.find_first_not_of("0123456789.") != std::string_view::npos) {
    throw invalid_parameter("series",
                            "must be a UID: numbers separated by dots, at most 64 characters");
  }
  return std::string(text);
}

std::string member_of(std::string_view text) {
  if (text.empty() || text.size() > limits::kLongestMemberName || has_control_characters(text)) {
    throw invalid_parameter("member", "must be the name of a file in the archive");
  }
  return std::string(text);
}

std::uint32_t volume_of(std::string_view text) {
  const auto number = whole_number(text);
  if (!number || *number > std::numeric_limits<std::uint32_t>::max()) {
    throw invalid_parameter("volume", "must be a whole number; 0 is the file's first volume");
  }
  return static_cast<std::uint32_t>(*number);
}

std::vector<std::string> accepted_of(std::string_view text) {
  std::vector<std::string> codes;
  for (const std::string_view name : split(text, ',')) {
    const NoteDescription* note = find_note(name);
    if (note == nullptr || !note->is_acceptable) {
      throw invalid_parameter("accept", in_quotes(name) + " cannot be accepted; these notes can: " +
                                            acceptable_notes());
    }
    if (std::ranges::find(codes, name) == codes.end()) codes.emplace_back(name);
  }
  return codes;
}

std::array<double, 3> spacing_of(std::string_view text) {
  const auto spacing = array_of<3>("spacing", text);
  if (std::ranges::all_of(spacing, [](double length) { return length > 0; })) return spacing;
  throw invalid_parameter("spacing", "must be three numbers above 0, separated by commas");
}

NiftiForm nifti_form_of(std::string_view text) {
  const auto form = from_string<NiftiForm>(text);
  if (!form) throw invalid_parameter("nifti_form", "must be " + names_of<NiftiForm>());
  return *form;
}

SaidModality modality_of(std::string_view text) {
  const auto modality = from_string<SaidModality>(text);
  if (!modality) throw invalid_parameter("modality", "must be " + names_of<SaidModality>());
  return *modality;
}

void refuse_choice_in_raw(const Request& request) {
  for (const std::string& name : file_parameters()) {
    if (request.has_parameter(name)) {
      throw invalid_parameter(name, "does not apply to raw samples");
    }
  }
}

std::string percent_decoded(std::string_view text) {
  std::string value;
  for (std::size_t at = 0; at < text.size(); ++at) {
    unsigned byte = 0;
    const char* digits = text.data() + at + 1;
    const bool is_encoded = text[at] == '%' && at + 2 < text.size() &&
                            std::from_chars(digits, digits + 2, byte, 16).ptr == digits + 2;
    value += is_encoded ? static_cast<char>(byte) : text[at];
    if (is_encoded) at += 2;
  }
  return value;
}

}  // namespace

const std::set<std::string>& import_parameters() {
  static const std::set<std::string> names = [] {
    std::set<std::string> all = raw_parameters();
    all.insert(file_parameters().begin(), file_parameters().end());
    all.insert("modality");
    return all;
  }();
  return names;
}

Parameters import_parameters_in(const Parameters& query) {
  Parameters found;
  std::ranges::copy_if(query, std::back_inserter(found), [](const auto& parameter) {
    return import_parameters().contains(parameter.first);
  });
  return found;
}

ImportOptions import_options_of(const Request& request) {
  ImportOptions options{.raw = raw_description_of(request)};
  const auto take = [&](const char* name, auto read, auto& option) {
    if (request.has_parameter(name)) option = read(request.parameter(name));
  };
  take("modality", modality_of, options.modality);
  if (options.raw) {
    refuse_choice_in_raw(request);
    return options;
  }
  take("series", series_of, options.series);
  take("member", member_of, options.member);
  options.masks = flag_of(request, "masks", false);
  take("volume", volume_of, options.volume);
  take("accept", accepted_of, options.accept);
  take("nifti_form", nifti_form_of, options.nifti_form);
  take("spacing", spacing_of, options.spacing);
  return options;
}

std::optional<RawDescription> raw_description_of(const Request& request) {
  const auto text = [&](const char* name) { return request.parameter(name); };
  if (!request.has_parameter("dims")) {
    for (const std::string& name : raw_parameters()) {
      // A file may have everything but its spacing.
      if (name != "spacing" && request.has_parameter(name)) {
        throw invalid_parameter("dims", "is required, because " + name + " describes raw samples");
      }
    }
    return std::nullopt;
  }
  RawDescription raw;
  raw.dims = dims_of(text("dims"));
  const auto type = from_string<SampleType>(text("type"));
  if (!type) throw invalid_parameter("type", "must be " + names_of<SampleType>());
  raw.type = *type;
  if (request.has_parameter("spacing")) {
    raw.geometry.spacing = array_of<3>("spacing", text("spacing"));
  }
  if (request.has_parameter("origin")) {
    raw.geometry.origin = array_of<3>("origin", text("origin"));
  }
  if (request.has_parameter("direction")) {
    raw.geometry.direction = array_of<9>("direction", text("direction"));
  }
  if (request.has_parameter("byte_order")) {
    const std::string_view order = text("byte_order");
    if (order != "little" && order != "big") {
      throw invalid_parameter("byte_order", "must be \"little\" or \"big\"");
    }
    raw.big_endian = order == "big";
  }
  return raw;
}

namespace {

// On one line and within the limit.
std::string plain_name(std::string_view name) {
  std::string plain(trimmed(name));
  std::erase_if(plain, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
  if (plain.size() <= limits::kLongestFileName) return plain;
  std::size_t end = limits::kLongestFileName;
  while (end > 0 && (static_cast<unsigned char>(plain[end]) & 0xC0) == 0x80) --end;
  return plain.substr(0, end);
}

// The extended form of a parameter precedes the plain one.
std::string text_parameter(std::string_view header, const std::string& name) {
  constexpr std::string_view kUtf8 = "utf-8''";
  const std::string extended = header_parameter(header, name + '*');
  if (lower(extended).starts_with(kUtf8)) {
    return percent_decoded(std::string_view(extended).substr(kUtf8.size()));
  }
  return header_parameter(header, name);
}

}  // namespace

std::string plain_file_name(std::string_view name) {
  const std::size_t folder = name.find_last_of("/\\");
  return plain_name(folder == std::string_view::npos ? name : name.substr(folder + 1));
}

isomesh::import::UploadName upload_name_of(std::string_view content_disposition) {
  const std::string chosen = plain_name(text_parameter(content_disposition, "name"));
  if (!chosen.empty()) return {volume::normalized(chosen), true};
  return {plain_file_name(text_parameter(content_disposition, "filename"))};
}

}  // namespace isomesh::http
