// Stands in for isomesh-dimse: reports that the PACS has the object "1.2" already, and for others
// has no processor time left as soon as it has its order.
#include <array>
#include <csignal>
#include <cstdlib>
#include <string>
#include <string_view>

#include <unistd.h>

#include "server/hospital/dimse/message.h"
#include "server/process/child.h"
#include "server/process/fork_server.h"

int main() {
  isomesh::process::serve_copies([] {
    std::array<char, 4096> order;
    const ssize_t bytes = ::read(isomesh::process::kChildDescriptor, order.data(), order.size());
    if (bytes <= 0) return;
    const std::string_view text(order.data(), static_cast<std::size_t>(bytes));
    if (text.find("\"1.2\"") != text.npos) {
      using isomesh::dimse::DimseEnd;
      using isomesh::dimse::DimseSent;
      const std::string line =
          isomesh::dimse::to_line(DimseSent{.end = DimseEnd::kResponded, .status = 0x0111});
      if (::write(isomesh::process::kChildDescriptor, line.data(), line.size()) < 0) std::abort();
      return;
    }
    std::raise(SIGXCPU);  // what the kernel sends at the limit
  });
}
