#include "base/command_line/closest.h"

#include <algorithm>
#include <numeric>
#include <string_view>
#include <utility>

namespace isomesh::command_line {
namespace {

// The Levenshtein distance: letters to insert, delete or replace.
std::size_t edits_between(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 0; i < a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i + 1);
    for (std::size_t j = 0; j < b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i] == b[j] ? 0 : 1);
      diagonal = std::exchange(row[j + 1], std::min({row[j] + 1, row[j + 1] + 1, replaced}));
    }
  }
  return row.back();
}

}  // namespace

std::string closest_to(const std::string& text, const std::vector<std::string>& names) {
  constexpr std::size_t kMostEdits = 3;
  std::string closest;
  // Short names are close to each other, so at most half of the letters may differ.
  std::size_t least = std::min(kMostEdits, text.size() / 2) + 1;
  for (const std::string& name : names) {
    const std::size_t edits = edits_between(text, name);
    if (edits < least) closest = name;
    least = std::min(least, edits);
  }
  return closest;
}

}  // namespace isomesh::command_line
