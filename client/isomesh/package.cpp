#include "client/isomesh/package.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <string_view>
#include <system_error>
#include <utility>

#include "base/files.h"
#include "base/text.h"
#include "proto/error.h"

namespace isomesh {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostFiles = 20000;  // the server's limit
constexpr std::size_t kMostLinks = 1000;   // to folders
constexpr std::size_t kBlock = 512;

// --- Which files ---------------------------------------------------------------------------------

// Throws Error kInvalidParameter for a path that cannot be looked at.
bool is_folder(const fs::path& path) {
  if (path.empty()) throw Error(ErrorCode::kInvalidParameter, "the name of a file is empty");
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (status.type() == fs::file_type::none) {
    throw Error(ErrorCode::kInvalidParameter, path.string() + ": " + error.message());
  }
  return fs::is_directory(status);
}

// The files below a folder. Links are followed: in DataLad's datasets all files are links to
// objects outside of the folder that a person names.
class Folder {
 public:
  explicit Folder(const fs::path& root) : root_(root) { visit(root); }

  std::vector<PackedFile> files() && { return std::move(files_); }

 private:
  [[noreturn]] void fail(const fs::path& path, const std::string& reason) const {
    throw Error(ErrorCode::kInvalidParameter, path.string() + ": " + reason);
  }

  void visit(const fs::path& folder) {
    std::error_code error;
    const fs::path real = fs::canonical(folder, error);
    if (error) fail(folder, error.message());
    if (std::ranges::find(above_, real) != above_.end()) {
      fail(folder, "leads back to a folder that it is in, by a link. Remove the link");
    }
    above_.push_back(real);
    fs::directory_iterator at(folder, error);
    for (; !error && at != fs::directory_iterator(); at.increment(error)) take(at->path());
    if (error) fail(folder, error.message());
    above_.pop_back();
  }

  void take(const fs::path& path) {
    // The objects of a dataset, which the links beside it name.
    if (path.filename() == ".git") return;
    std::error_code error;
    const fs::file_status status = fs::status(path, error);
    std::error_code ignored;
    const bool is_link = fs::is_symlink(fs::symlink_status(path, ignored));
    const bool leads_nowhere = status.type() == fs::file_type::not_found ||
                               error == std::errc::too_many_symbolic_link_levels;
    if (is_link && leads_nowhere) {
      // Editors mark a file that is open by a hidden link to nothing (`.#name`).
      if (path.filename().string().starts_with('.')) return;
      fail(path,
           "is a link to a file that is not there. Get the file, in a dataset with `datalad get`, "
           "or remove the link");
    }
    if (status.type() == fs::file_type::none) fail(path, error.message());
    if (fs::is_directory(status)) {
      // Links can multiply folders without files.
      if (is_link && ++links_ > kMostLinks) {
        fail(root_, "contains more than " + std::to_string(kMostLinks) +
                        " links to folders. Upload its folders one by one");
      }
      return visit(path);
    }
    if (!fs::is_regular_file(status)) return;
    files_.push_back({path.lexically_relative(root_).generic_string(), path});
    if (files_.size() > kMostFiles) {
      fail(root_, "contains more than " + std::to_string(kMostFiles) + " files");
    }
  }

  const fs::path& root_;
  std::vector<fs::path> above_;  // the real paths of the folders that are being visited
  std::size_t links_ = 0;        // to folders
  std::vector<PackedFile> files_;
};

std::vector<PackedFile> files_below(const fs::path& folder) {
  std::vector<PackedFile> files = Folder(folder).files();
  if (files.empty()) {
    throw Error(ErrorCode::kInvalidParameter, folder.string() + ": contains no files");
  }
  std::ranges::sort(files, {}, &PackedFile::name);
  return files;
}

// The lines of a header's first megabyte, which is text and names the data.
std::vector<std::string> lines_of(const fs::path& path) {
  constexpr std::uint64_t kMostBytes = std::uint64_t{1} << 20;
  const InputFile file = InputFile::chosen(path);
  std::string text(static_cast<std::size_t>(std::min(file.size(), kMostBytes)), '\0');
  file.read_exactly(0, std::as_writable_bytes(std::span(text)));
  const std::vector<std::string_view> found = lines(text);
  return {found.begin(), found.end()};
}

// The value of the field `name` if the line is "Name = value" or "name: value".
std::optional<std::string> field(const std::string& line, char sign, std::string_view name) {
  const std::size_t at = line.find(sign);
  if (at == std::string::npos) return std::nullopt;
  std::string found = lower(trimmed(std::string_view(line).substr(0, at)));
  std::erase(found, ' ');
  if (found != name) return std::nullopt;
  return std::string(trimmed(std::string_view(line).substr(at + 1)));
}

// The files of a folder that may match a pattern such as "slice%03d.raw 1 93 1". The server
// evaluates the whole pattern.
std::vector<std::string> names_like(const fs::path& folder, std::string_view said) {
  const std::string_view pattern = said.substr(0, said.find_first_of(" \t"));
  const std::size_t percent = pattern.find('%');
  const std::size_t letter = pattern.find_first_not_of("0123456789", percent + 1);
  if (percent == std::string_view::npos || letter == std::string_view::npos) return {};
  const std::string_view before = pattern.substr(0, percent);
  const std::string_view after = pattern.substr(letter + 1);
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator at(folder.empty() ? "." : folder, error);
       !error && at != fs::directory_iterator(); at.increment(error)) {
    const std::string name = at->path().filename().string();
    if (!name.starts_with(before) || !name.ends_with(after)) continue;
    if (name.size() <= before.size() + after.size()) continue;
    const auto number = name.substr(before.size(), name.size() - before.size() - after.size());
    if (number.find_first_not_of(" 0123456789") == std::string::npos) names.push_back(name);
  }
  std::ranges::sort(names);
  return names;
}

std::vector<PackedFile> header_and_data(const fs::path& path, char sign, std::string_view name) {
  std::vector<PackedFile> files = {{path.filename().string(), path}};
  const auto add = [&](const std::string& data) {
    // Data outside of the header's folder is not sent: the server rejects such a header.
    const fs::path below = fs::path(data).lexically_normal();
    const bool outside = data.empty() || below.is_absolute() || below.string().starts_with("..");
    if (!outside && below != files.front().name) {
      files.push_back({below.generic_string(), path.parent_path() / below});
    }
  };
  const std::vector<std::string> lines = lines_of(path);
  for (std::size_t at = 0; at < lines.size(); ++at) {
    const auto data = field(lines[at], sign, name);
    if (!data || lower(*data) == "local") continue;
    if (data->starts_with("LIST")) {
      for (const auto& line : std::span(lines).subspan(at + 1)) add(line);
    } else if (data->find('%') != std::string::npos) {
      for (const auto& like : names_like(path.parent_path(), *data)) add(like);
    } else {
      add(*data);
    }
    break;
  }
  return files;
}

// The suffixes of a header and of its samples. A program writes one of each.
struct PairSuffixes {
  std::vector<std::string> header;
  std::vector<std::string> samples;
};

// The header or the samples of a pair: `path` itself, or else the first that is beside it.
std::vector<PackedFile> one_of(const fs::path& path, const std::string& stem,
                               const std::vector<std::string>& suffixes) {
  std::vector<fs::path> found;
  std::error_code error;
  for (const std::string& suffix : suffixes) {
    const fs::path one = path.parent_path() / (stem + suffix);
    if (one == path) return {{path.filename().string(), path}};
    if (fs::is_regular_file(one, error)) found.push_back(one);
  }
  if (found.empty()) return {};
  return {{found.front().filename().string(), found.front()}};
}

std::optional<std::string> stem_of(const std::string& name,
                                   const std::vector<std::string>& suffixes) {
  for (const std::string& suffix : suffixes) {
    if (name.size() > suffix.size() && name.ends_with(suffix)) {
      return name.substr(0, name.size() - suffix.size());
    }
  }
  return std::nullopt;
}

// The header and the samples of a pair, from either of them. Empty for other names.
std::vector<PackedFile> pair_of(const fs::path& path) {
  static const std::vector<PairSuffixes> pairs = {{{".hdr", ".hdr.gz"}, {".img", ".img.gz"}},
                                                  {{".HEAD"}, {".BRIK", ".BRIK.gz", ".BRIK.bz2"}},
                                                  {{".PAR"}, {".REC"}},
                                                  {{".par"}, {".rec"}}};
  const std::string name = path.filename().string();
  for (const auto& [header, samples] : pairs) {
    auto stem = stem_of(name, header);
    if (!stem) stem = stem_of(name, samples);
    if (!stem) continue;
    std::vector<PackedFile> files = one_of(path, *stem, header);
    for (PackedFile& file : one_of(path, *stem, samples)) files.push_back(std::move(file));
    return files;
  }
  return {};
}

// --- TAR (POSIX.1-2001, pax) ---------------------------------------------------------------------

struct Member {
  std::string name;
  char kind = '0';
  std::uint64_t bytes = 0;
};

// A member's header block. Values that do not fit are in the preceding pax record.
std::string header_of(const Member& member) {
  constexpr std::size_t kLongestName = 100;
  std::string block(kBlock, '\0');
  const auto put = [&](std::size_t at, std::string_view text) {
    std::ranges::copy(text, block.begin() + static_cast<std::ptrdiff_t>(at));
  };
  const auto octal = [](std::uint64_t value, int digits) {
    std::array<char, 24> text = {};
    std::snprintf(text.data(), text.size(), "%0*llo", digits,
                  static_cast<unsigned long long>(value));
    return std::string(text.data());
  };
  constexpr std::uint64_t kLargest = (std::uint64_t{1} << 33) - 1;
  put(0, member.name.substr(0, kLongestName));
  put(100, "0000644");
  put(108, "0000000");
  put(116, "0000000");
  put(124, octal(std::min(member.bytes, kLargest), 11));
  put(136, octal(0, 11));
  put(148, "        ");
  block[156] = member.kind;
  put(257, std::string_view("ustar\00000", 8));
  unsigned sum = 0;
  for (const char byte : block) sum += static_cast<unsigned char>(byte);
  put(148, octal(sum, 6) + std::string(1, '\0'));
  return block;
}

std::string padded(std::string text) {
  text.resize((text.size() + kBlock - 1) / kBlock * kBlock, '\0');
  return text;
}

// For example "30 path=...\n", where the number is the record's length, including its own digits.
std::string pax_record(const std::string& key, const std::string& value) {
  const std::string rest = " " + key + "=" + value + "\n";
  std::size_t length = rest.size() + 1;
  while (std::to_string(length).size() + rest.size() != length) ++length;
  return std::to_string(length) + rest;
}

// The bytes before a member's content: its pax record and its header.
std::string lead_of(const Member& member) {
  const std::string records =
      pax_record("path", member.name) + pax_record("size", std::to_string(member.bytes));
  return header_of({"pax", 'x', records.size()}) + padded(records) + header_of(member);
}

}  // namespace

std::vector<PackedFile> files_of_upload(const std::filesystem::path& path) {
  if (is_folder(path)) return files_below(path);
  const std::string suffix = lower(path.extension().string());
  if (suffix == ".mhd") return header_and_data(path, '=', "elementdatafile");
  if (suffix == ".nhdr") return header_and_data(path, ':', "datafile");
  if (std::vector<PackedFile> pair = pair_of(path); !pair.empty()) return pair;
  return {{path.filename().string(), path}};
}

std::vector<PackedFile> files_of_upload(const std::vector<std::filesystem::path>& paths) {
  std::vector<PackedFile> files;
  for (const fs::path& path : paths) {
    for (PackedFile& file : files_of_upload(path)) {
      const auto same = std::ranges::find(files, file.name, &PackedFile::name);
      std::error_code error;
      if (same == files.end()) {
        files.push_back(std::move(file));
      } else if (!fs::equivalent(same->path, file.path, error)) {
        throw Error(ErrorCode::kInvalidParameter,
                    file.path.string() + ": another file in this upload has the same name");
      }
    }
  }
  return files;
}

UploadBody::UploadBody(const std::vector<std::filesystem::path>& paths) {
  if (paths.empty()) throw Error(ErrorCode::kInvalidParameter, "there are no files to upload");
  const std::vector<PackedFile> files = files_of_upload(paths);
  if (files.size() == 1 && !is_folder(paths.front())) {
    add_file(files.front().path, InputFile::chosen(files.front().path).size());
    return;
  }
  for (const PackedFile& file : files) add_member(file);
  add_text(std::string(2 * kBlock, '\0'));
}

void UploadBody::add_text(std::string text) {
  const std::uint64_t bytes = text.size();
  parts_.push_back({size_, bytes, std::move(text), {}});
  size_ += bytes;
}

void UploadBody::add_file(const std::filesystem::path& path, std::uint64_t bytes) {
  parts_.push_back({size_, bytes, {}, path});
  size_ += bytes;
}

void UploadBody::add_member(const PackedFile& file) {
  const std::uint64_t bytes = InputFile::chosen(file.path).size();
  add_text(lead_of({.name = file.name, .bytes = bytes}));
  add_file(file.path, bytes);
  add_text(std::string((kBlock - bytes % kBlock) % kBlock, '\0'));
}

void UploadBody::read(std::uint64_t offset, std::span<char> target) const {
  auto part = std::ranges::upper_bound(parts_, offset, {}, &Part::offset);
  for (--part; !target.empty() && part != parts_.end(); ++part) {
    const std::uint64_t from = offset - part->offset;
    const std::size_t count = std::min<std::uint64_t>(part->bytes - from, target.size());
    read_part(static_cast<std::size_t>(part - parts_.begin()), from, target.first(count));
    target = target.subspan(count);
    offset += count;
  }
}

void UploadBody::read_part(std::size_t index, std::uint64_t offset, std::span<char> target) const {
  const Part& part = parts_[index];
  if (target.empty()) return;
  if (part.path.empty()) {
    std::ranges::copy(std::string_view(part.text).substr(offset, target.size()), target.begin());
    return;
  }
  if (!open_file_ || open_part_ != index) {
    open_file_ = std::make_unique<InputFile>(InputFile::chosen(part.path));
    open_part_ = index;
  }
  open_file_->read_exactly(offset, std::as_writable_bytes(target));
}

}  // namespace isomesh
