#include "server/token_command.h"

#include <cerrno>
#include <fstream>
#include <iostream>

#include <fcntl.h>
#include <unistd.h>

#include "server/http/guards/auth.h"

namespace isomesh {
namespace {

// In one write at the file's end, so that lines of two such commands do not mix.
void append(const std::filesystem::path& file, const std::string& line) {
  constexpr mode_t kOwnerOnly = 0600;
  const int descriptor =
      ::open(file.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, kOwnerOnly);
  const bool written =
      descriptor >= 0 &&
      ::write(descriptor, line.data(), line.size()) == static_cast<ssize_t>(line.size()) &&
      ::fsync(descriptor) == 0;
  if (descriptor >= 0) ::close(descriptor);
  if (!written) throw Error(ErrorCode::kInternal, "cannot write to the file of tokens");
}

}  // namespace

void make_token(const TokenRequest& request) {
  const auto role = http::role_from(request.role);
  if (!role) throw invalid_parameter("role", "must be user, admin or monitor");
  const std::string token = http::make_token();
  const std::string line = http::token_line(request.name, *role, token);
  if (!request.file.empty()) append(request.file, line + '\n');
  std::cout << token << '\n';
  if (request.file.empty()) std::cout << line << '\n';
  std::cout.flush();
}

}  // namespace isomesh
