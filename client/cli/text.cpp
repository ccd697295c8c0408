#include "client/cli/text.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <string_view>

#include "base/hex.h"
#include "base/text.h"

namespace isomesh::cli {
namespace {

std::string printed(const char* format, int precision, double value) {
  std::array<char, 400> text{};
  std::snprintf(text.data(), text.size(), format, precision, value);
  return text.data();
}

// Counts characters instead of bytes, because UTF-8 takes several bytes for one.
std::size_t width_of(std::string_view text) {
  const auto starts = [](char c) { return (static_cast<unsigned char>(c) & 0xC0) != 0x80; };
  return static_cast<std::size_t>(std::ranges::count_if(text, starts));
}

}  // namespace

std::string with_commas(std::string digits) {
  const std::size_t first = digits.starts_with('-') ? 1 : 0;
  for (std::size_t end = digits.size(); end > first + 3; end -= 3) digits.insert(end - 3, ",");
  return digits;
}

std::string fixed(double value, int decimals) {
  std::string text = printed("%.*f", decimals, value);
  if (!std::isfinite(value)) return text;
  const std::size_t point = std::min(text.find('.'), text.size());
  return with_commas(text.substr(0, point)) + text.substr(point);
}

std::string human_bytes(std::uint64_t bytes) {
  constexpr std::array kUnits = {"B", "kB", "MB", "GB", "TB"};
  auto value = static_cast<double>(bytes);
  std::size_t unit = 0;
  // 999.95 would be printed as 1000.0.
  for (; unit + 1 < kUnits.size() && value >= (unit == 0 ? 1000 : 999.95); ++unit) value /= 1000;
  return printed("%.*f", unit == 0 ? 0 : 1, value) + " " + kUnits[unit];
}

std::string human_duration(double milliseconds) {
  if (milliseconds < 999.95) return printed("%.*f", 1, milliseconds) + " ms";
  if (milliseconds < 59'995) return printed("%.*f", 2, milliseconds / 1000) + " s";
  const auto whole = static_cast<std::int64_t>(std::llround(milliseconds / 1000));
  const std::string rest = std::to_string(whole % 60);
  return grouped(whole / 60) + " min " + (rest.size() < 2 ? "0" : "") + rest + " s";
}

std::string human_number(double value) { return printed("%.*g", 6, value); }

std::string in_columns(const std::vector<Align>& columns,
                       std::vector<std::vector<std::string>> rows) {
  for (auto& row : rows) std::ranges::transform(row, row.begin(), printable);
  std::vector<std::size_t> widths(columns.size());
  for (const auto& row : rows) {
    for (std::size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], width_of(row[c]));
  }
  std::string text;
  for (const auto& row : rows) {
    std::string line;
    for (std::size_t c = 0; c < row.size(); ++c) {
      const std::string padding(widths[c] - width_of(row[c]), ' ');
      line += "  " + (columns[c] == Align::kRight ? padding + row[c] : row[c] + padding);
    }
    line.erase(line.find_last_not_of(' ') + 1);
    text += line + '\n';
  }
  return text;
}

std::string with_escapes(std::string_view json) {
  std::string text;
  const auto escape = [&](char byte) { text += "\\u00" + to_hex(std::string_view(&byte, 1)); };
  for (std::size_t at = 0; at < json.size(); ++at) {
    const unsigned next = at + 1 < json.size() ? static_cast<unsigned char>(json[at + 1]) : 0;
    if (json[at] == '\x7F') {
      escape(json[at]);
    } else if (json[at] == '\xC2' && next >= 0x80 && next < 0xA0) {
      escape(json[++at]);
    } else {
      text += json[at];
    }
  }
  return text;
}

std::string shell_word(std::string_view text) {
  const std::string word = printable(text);
  const auto is_word = [](char c) {
    return is_plain(c) || std::string_view("/,:+@%").find(c) != std::string_view::npos;
  };
  if (!word.empty() && std::ranges::all_of(word, is_word)) return word;
  std::string quoted = "'";
  for (const char c : word) quoted += c == '\'' ? "'\\''" : std::string(1, c);
  return quoted + '\'';
}

std::string with_options(std::string text) {
  constexpr std::array<std::array<std::string_view, 2>, 12> kOptions = {
      {{"\"labels\": \"all\"", "--labels all"},
       {"nifti_form=", "--nifti-form "},
       {"scheme=", "--scheme "},
       {"smoothing=", "--smoothing "},
       {"regularize=false", "--no-regularize"},
       {"member=NAME", "--member NAME"},
       {"series=UID", "--series UID"},
       {"volume=N", "--volume N"},
       {"spacing=X,Y,Z", "--spacing X,Y,Z"},
       {"dims (X,Y,Z) and type", "--dims X,Y,Z and --type"},
       {"the box of crop", "the box of --crop"},
       {"; close adds", "; --close adds"}}};
  for (const auto& [parameter, option] : kOptions) {
    const std::size_t at = text.find(parameter);
    if (at != std::string::npos) text.replace(at, parameter.size(), option);
  }
  return text;
}

}  // namespace isomesh::cli
