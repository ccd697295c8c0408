// Numbers for people, and columns. Pure functions.
#pragma once

#include <concepts>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace isomesh::cli {

std::string with_commas(std::string digits);
std::string grouped(std::integral auto value) {  // 1,234,567
  return with_commas(std::to_string(value));
}
std::string fixed(double value, int decimals);    // grouped before the point
std::string human_bytes(std::uint64_t bytes);     // 512 B, 3.5 MB: powers of 1000
std::string human_duration(double milliseconds);  // 12.3 ms, 4.56 s, 2 min 03 s
std::string human_number(double value);           // six significant digits

enum class Align { kLeft, kRight };

// Lines of cells under each other, two spaces between columns, indented by two, nothing at the end
// of a line. Rows may be shorter than `columns`; cells may hold UTF-8. Control characters, which
// files and servers may send to the terminal, are replaced.
std::string in_columns(const std::vector<Align>& columns,
                       std::vector<std::vector<std::string>> rows);

// JSON with \\u escapes for the control characters that it may have as they are, which some
// terminals obey: U+007F to U+009F.
std::string with_escapes(std::string_view json);

// A word for a line that a person may copy to a shell: as it is, or in quotes if a shell would take
// it for something else. Control characters are replaced.
std::string shell_word(std::string_view text);

// A text of the server, in which the command's options replace the API's parameters: "--member
// NAME" for "member=NAME".
std::string with_options(std::string text);

}  // namespace isomesh::cli
