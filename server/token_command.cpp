#include "server/token_command.h"

#include <algorithm>
#include <iostream>
#include <sstream>
#include <string_view>
#include <vector>

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "base/files.h"
#include "server/http/guards/tokens.h"

namespace isomesh {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kShownDigits = 12;  // of a hash: enough to distinguish tokens

[[noreturn]] void cannot_write() {
  throw Error(ErrorCode::kInternal, "the file of tokens cannot be written");
}

void check_is_given(const fs::path& file) {
  if (file.empty()) throw invalid_parameter("tokens", "name the file with --tokens FILE");
}

// Held while the file is read and written, so that concurrent commands lose no lines. Locks the
// folder, because the file is replaced.
Descriptor lock_folder_of(const fs::path& file) {
  const fs::path folder = file.has_parent_path() ? file.parent_path() : ".";
  Descriptor lock(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (lock.number() < 0) {
    throw invalid_parameter("tokens", "the folder of " + file.string() + " does not exist");
  }
  if (::flock(lock.number(), LOCK_EX) != 0) cannot_write();
  return lock;
}

std::vector<std::string> lines_of(const fs::path& file) {
  std::vector<std::string> lines;
  std::istringstream text(read_whole(file));
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

// Replaces the file atomically, with its owner and mode.
void replace(const fs::path& file, const std::vector<std::string>& lines) {
  std::string text;
  for (const std::string& line : lines) text += line + '\n';
  struct stat before = {};
  const bool is_there = ::stat(file.c_str(), &before) == 0;
  constexpr mode_t kOwnerOnly = 0600;
  const fs::path part = file.string() + ".part";
  {
    const Descriptor written(
        ::open(part.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, kOwnerOnly));
    const int number = written.number();
    const bool is_whole = number >= 0 && ::write(number, text.data(), text.size()) ==
                                             static_cast<ssize_t>(text.size());
    const bool looks_the_same =
        is_whole && (!is_there || (::fchown(number, before.st_uid, before.st_gid) == 0 &&
                                   ::fchmod(number, before.st_mode & ALLPERMS) == 0));
    if (!looks_the_same || ::fsync(number) != 0) {
      ::unlink(part.c_str());
      cannot_write();
    }
  }
  if (::rename(part.c_str(), file.c_str()) != 0) cannot_write();
}

struct TokenLine {
  std::string name;
  std::string role;
  std::string hash;
};

// The names are empty for a comment or a blank line.
TokenLine parsed(const std::string& line) {
  TokenLine token;
  std::istringstream words(line);
  words >> token.name >> token.role >> token.hash;
  return token.name.starts_with('#') ? TokenLine{} : token;
}

void tell(const std::string& text) {
  std::cout << text << std::endl;
  if (!std::cout) throw Error(ErrorCode::kInternal, "standard output cannot be written to");
}

}  // namespace

void add_token(const TokenRequest& request) {
  const fs::path file = behind_links(request.file);
  const auto role = http::role_from(request.role);
  if (!role) throw invalid_parameter("role", "must be user, admin or monitor");
  const std::string token = http::make_token();
  const std::string line = http::token_line(request.name, *role, token);
  if (!file.empty()) {
    const Descriptor lock = lock_folder_of(file);
    std::vector<std::string> lines;
    if (fs::exists(file)) lines = lines_of(file);
    const bool has_tokens = std::ranges::any_of(
        lines, [](const std::string& each) { return !parsed(each).name.empty(); });
    // The next start would reject it otherwise.
    if (has_tokens) const http::Tokens readable(file, http::ReadBy::kAdministrator);
    for (const std::string& each : lines) {
      const TokenLine other = parsed(each);
      if (other.name == request.name && other.role != request.role) {
        throw invalid_parameter(
            "role", request.name + " already has the role " + other.role + "; a name has one role");
      }
    }
    lines.push_back(line);
    tell(token);  // first: an unseen token is useless, and its hash would stay
    replace(file, lines);
    return;
  }
  tell(token + '\n' + line);
}

void list_tokens(const TokenRequest& request) {
  check_is_given(request.file);
  const http::Tokens readable(request.file, http::ReadBy::kAdministrator);
  for (const std::string& line : lines_of(request.file)) {
    const TokenLine token = parsed(line);
    if (token.name.empty()) continue;
    std::cout << token.name << ' ' << token.role << ' ' << token.hash.substr(0, kShownDigits)
              << '\n';
  }
  std::cout.flush();
}

void revoke_tokens(const TokenRequest& request) {
  check_is_given(request.file);
  const fs::path file = behind_links(request.file);
  const Descriptor lock = lock_folder_of(file);
  const http::Tokens readable(file, http::ReadBy::kAdministrator);
  std::vector<std::string> kept;
  std::size_t revoked = 0;
  std::size_t left = 0;
  for (const std::string& line : lines_of(file)) {
    const TokenLine token = parsed(line);
    if (token.name == request.name && token.hash.starts_with(request.hash)) {
      ++revoked;
      continue;
    }
    if (!token.name.empty()) ++left;
    kept.push_back(line);
  }
  if (revoked == 0) {
    throw invalid_parameter(
        "name", request.name + " has no such token; `isomeshd token list --tokens FILE` lists all");
  }
  if (left == 0) {
    throw invalid_parameter("name",
                            "no token would be left, and a daemon rejects a file without tokens: "
                            "add another token first, or stop the daemon");
  }
  replace(file, kept);
  std::cout << "revoked " << revoked << (revoked == 1 ? " token" : " tokens")
            << "; send SIGHUP to a running daemon" << std::endl;
}

}  // namespace isomesh
