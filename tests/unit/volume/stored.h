// Volumes of tests as files.
#pragma once

#include <cstring>
#include <memory>
#include <vector>

#include "server/volume/canonical.h"
#include "tests/support/files.h"

namespace isomesh::volume::test {

// The samples as the file "volume" of the folder.
template <class Sample>
std::shared_ptr<const CanonicalFile> stored(const isomesh::test::TemporaryFolder& folder,
                                            const CanonicalHeader& header,
                                            const std::vector<Sample>& samples) {
  CanonicalWriter writer(folder / "volume", header);
  std::memcpy(writer.samples().data(), samples.data(), writer.samples().size());
  return std::make_shared<const CanonicalFile>(folder / "volume");
}

}  // namespace isomesh::volume::test
