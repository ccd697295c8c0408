#include "proto/parameters.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <string_view>

#include "base/text.h"
#include "proto/json.h"
#include "proto/json_tree.h"
#include "proto/presets.h"

namespace isomesh {
namespace {

const FormatRow& row_of(MeshFormat format) {
  return *std::ranges::find(kFormatRows, format, &FormatRow::format);
}

// As a request that leaves everything out is completed.
JsonTree completed(JobParameters parameters) {
  parameters.lambda = default_lambda(parameters);
  return JsonTree(to_json(parameters));
}

}  // namespace

double default_lambda(const MeshParameters& parameters) {
  const SmoothingRow& row = row_of(parameters.smoothing);
  const double usual = row.lambda.value_or(1);
  return parameters.labels ? row.lambda_by_labels.value_or(usual) : usual;
}

Space space_of(MeshFormat format, const MeshParameters& parameters) {
  return row_of(format).own_space.value_or(parameters.space);
}

bool holds_all_labels(MeshFormat format) { return row_of(format).holds_all_labels; }

std::string_view file_suffix(MeshFormat format) {
  const FormatRow& row = row_of(format);
  return row.file_suffix.empty() ? row.name : row.file_suffix;
}

std::vector<MeshFormat> files_of(const MeshParameters& parameters) {
  if (!parameters.labels) return parameters.formats;
  std::vector<MeshFormat> files;
  std::ranges::copy_if(parameters.formats, std::back_inserter(files), holds_all_labels);
  if (!zipped_formats(parameters).empty()) files.push_back(MeshFormat::kZip);
  return files;
}

std::vector<MeshFormat> zipped_formats(const MeshParameters& parameters) {
  std::vector<MeshFormat> zipped;
  for (const MeshFormat format : parameters.formats) {
    if (row_of(format).is_zipped) zipped.push_back(format);
  }
  const bool is_asked =
      std::ranges::find(parameters.formats, MeshFormat::kZip) != parameters.formats.end();
  if (zipped.empty() && is_asked) zipped.push_back(MeshFormat::kStl);
  return zipped;
}

std::string default_by_labels(const Parameter& parameter) {
  static const JsonTree at_iso = completed({});
  static const JsonTree by_labels = completed(label_parameters({}));
  if (parameter.jobs != JobKind::kAny) return "";
  const Json* const usual = json_values::find(at_iso.root(), parameter.name);
  const Json* const other = json_values::find(by_labels.root(), parameter.name);
  if (usual == nullptr || other == nullptr) return "";
  std::string text = dump(*other);
  if (text == dump(*usual)) return "";
  std::erase(text, '"');
  return text;
}

std::string query_name_of(const Parameter& parameter) {
  return parameter.query == nullptr ? parameter.name : parameter.query;
}

std::string option_name_of(const Parameter& parameter) {
  if (parameter.option != nullptr) return parameter.option;
  std::string name = query_name_of(parameter);
  const std::string unit = std::string("_") + parameter.unit;
  if (unit.size() > 1 && name.ends_with(unit)) name.resize(name.size() - unit.size());
  std::ranges::replace(name, '_', '-');
  return name;
}

std::string range_of(const Parameter& parameter) {
  std::string text;
  if (parameter.minimum) {
    text = parameter.maximum ? "from " : "of at least ";
    text += number_text(*parameter.minimum);
  } else if (parameter.above) {
    text = "above " + number_text(*parameter.above);
  }
  if (!parameter.maximum) return text;
  text += parameter.minimum ? " to " : text.empty() ? "of at most " : " and at most ";
  return text + number_text(*parameter.maximum);
}

std::string must_be(const Parameter& parameter, bool is_whole) {
  // Without an upper bound, "a number" would include the infinite ones.
  const std::string kind = is_whole            ? "whole number"
                           : parameter.maximum ? "number"
                                               : "finite number";
  const std::string range = range_of(parameter);
  std::vector<std::string> all = {"must be a " + kind + (range.empty() ? "" : ' ' + range)};
  if (parameter.when_empty != nullptr) all.push_back(in_quotes(parameter.when_empty));
  for (const std::string& name : presets_of(parameter)) all.push_back(in_quotes(name));
  return listed(all);
}

std::vector<std::string> presets_of(const Parameter& parameter) {
  std::vector<std::string> names;
  for (const PresetRow& row : kPresets) {
    if (parameter.takes_presets) names.push_back(name_in_requests(row));
  }
  return names;
}

std::string number_text(double number) {
  constexpr double kWholeBelow = 1e15;
  std::array<char, 32> digits = {};
  const bool is_whole = std::floor(number) == number && std::abs(number) < kWholeBelow;
  const auto end =
      is_whole ? std::to_chars(digits.begin(), digits.end(), static_cast<std::int64_t>(number)).ptr
               : std::to_chars(digits.begin(), digits.end(), number).ptr;
  return {digits.data(), end};
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (std::size_t n = 0; n < names.size(); ++n) {
    if (n > 0) text += n + 1 == names.size() ? " or " : ", ";
    text += names[n];
  }
  return text;
}

}  // namespace isomesh
