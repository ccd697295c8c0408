#include "server/net/descriptors.h"

#include <algorithm>
#include <cerrno>
#include <string>

#include <sys/resource.h>

#include "base/error.h"

namespace isomesh::net {

std::size_t raise_descriptor_limit() {
  rlimit limit = {};
  if (::getrlimit(RLIMIT_NOFILE, &limit) != 0) throw_system_error("getrlimit", errno);
  const rlimit raised = {limit.rlim_max, limit.rlim_max};
  // Some systems report no limit but reject an unlimited value.
  if (::setrlimit(RLIMIT_NOFILE, &raised) == 0) limit = raised;
  if (limit.rlim_cur < kFewestDescriptors) {
    throw Error(ErrorCode::kUnavailable,
                "at least " + std::to_string(kFewestDescriptors) +
                    " file descriptors are needed, and the limit is " +
                    std::to_string(limit.rlim_cur) +
                    ": raise it with `ulimit -n`, LimitNOFILE= of systemd, or --ulimit nofile= of "
                    "Docker");
  }
  return limit.rlim_cur;
}

std::size_t connections_within(std::size_t descriptors) {
  constexpr std::size_t kReserve = 384;
  constexpr std::size_t kEach = 2;
  constexpr std::size_t kFewest = 8;
  constexpr std::size_t kMost = 4096;  // each may hold tens of kilobytes of a response
  const std::size_t reserve = std::min(kReserve, descriptors / 2);
  return std::clamp((descriptors - reserve) / kEach, kFewest, kMost);
}

}  // namespace isomesh::net
