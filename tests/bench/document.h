// A Markdown file with plots beside it.
#pragma once

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "tests/bench/svg_plot.h"

namespace isomesh::bench {

// Collects text; plots are written at once, into the folder `report` beside the document. Not
// thread safe.
class Document {
 public:
  // Makes the folders. Throws std::filesystem::filesystem_error.
  explicit Document(const std::filesystem::path& folder);

  void heading(const std::string& text);
  void paragraph(const std::string& text);
  void bullets(const std::vector<std::string>& lines);
  // The first column is aligned to the left, the others to the right.
  void table(const std::vector<std::string>& head,
             const std::vector<std::vector<std::string>>& rows);
  // Throws std::runtime_error when the file cannot be written.
  void plot(const std::string& name, const Plot& plot);

  // Writes REPORT.md. Throws std::runtime_error when it cannot.
  void write() const;

 private:
  std::filesystem::path folder_;
  std::ostringstream text_;
};

}  // namespace isomesh::bench
