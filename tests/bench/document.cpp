#include "tests/bench/document.h"

#include <fstream>
#include <stdexcept>

namespace isomesh::bench {
namespace {

constexpr const char* kPlotFolder = "report";

void write_file(const std::filesystem::path& path, const std::string& content) {
  std::ofstream file(path, std::ios::binary);
  file << content << std::flush;
  if (!file) throw std::runtime_error("cannot write " + path.string());
}

}  // namespace

Document::Document(const std::filesystem::path& folder) : folder_(folder) {
  std::filesystem::create_directories(folder_ / kPlotFolder);
}

void Document::heading(const std::string& text) {
  const bool is_title = text_.tellp() == 0;
  text_ << (is_title ? "# " : "\n## ") << text << "\n";
}

void Document::paragraph(const std::string& text) { text_ << '\n' << text << '\n'; }

void Document::bullets(const std::vector<std::string>& lines) {
  text_ << '\n';
  for (const std::string& line : lines) text_ << "* " << line << '\n';
}

void Document::table(const std::vector<std::string>& head,
                     const std::vector<std::vector<std::string>>& rows) {
  const auto row = [&](const std::vector<std::string>& cells) {
    for (const std::string& cell : cells) text_ << "| " << cell << ' ';
    text_ << "|\n";
  };
  text_ << '\n';
  row(head);
  for (std::size_t i = 0; i < head.size(); ++i) text_ << (i == 0 ? "|---" : "|---:");
  text_ << "|\n";
  for (const auto& cells : rows) row(cells);
}

void Document::plot(const std::string& name, const Plot& plot) {
  const std::string file = std::string(kPlotFolder) + '/' + name + ".svg";
  write_file(folder_ / file, to_svg(plot));
  text_ << "\n![" << plot.title << "](" << file << ")\n";
}

void Document::write() const { write_file(folder_ / "REPORT.md", text_.str()); }

}  // namespace isomesh::bench
