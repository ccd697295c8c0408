#include "server/hospital/dimse/daemon_channel.h"

#include <array>
#include <cerrno>
#include <cstdlib>

#include <sys/socket.h>
#include <unistd.h>

#include "base/descriptor.h"
#include "server/process/child.h"
#include "server/process/passing.h"

namespace isomesh::dimse {
namespace {

Descriptor& peer() {
  static Descriptor descriptor;
  return descriptor;
}

}  // namespace

std::string read_order() {
  std::string line;
  std::array<char, 4096> piece = {};
  while (!line.ends_with('\n')) {
    process::Received received = process::receive(process::kChildDescriptor, piece);
    if (received.count < 0 && errno == EINTR) continue;
    if (received.count <= 0) return "";
    if (received.passed.number() >= 0) peer() = std::move(received.passed);
    line.append(piece.data(), static_cast<std::size_t>(received.count));
  }
  return line;
}

int peer_socket() { return peer().number(); }

dimse::DimseVerdict read_verdict() {
  char verdict = 0;
  ssize_t count = 0;
  do {
    count = ::read(process::kChildDescriptor, &verdict, 1);
  } while (count < 0 && errno == EINTR);
  if (count != 1) std::_Exit(EXIT_FAILURE);
  return static_cast<dimse::DimseVerdict>(verdict);
}

}  // namespace isomesh::dimse

// DCMTK opens its own connections, but this process may not open any. These functions replace those
// of the C library, and give DCMTK the daemon's connection whenever it connects a socket.
extern "C" {

int socket(int, int, int) noexcept { return ::dup(isomesh::dimse::peer_socket()); }

int connect(int, const sockaddr*, socklen_t) { return 0; }

}  // extern "C"
