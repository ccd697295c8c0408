// The stores of blobs, for the tests that every one has to pass. Another one derives from
// BlobEngine and adds itself to all_blob_engines().
#pragma once

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <gtest/gtest.h>

#include "server/store/blob_store.h"

namespace isomesh::test {

// An empty place for blobs, gone with all it holds when it goes.
class BlobEngine {
 public:
  virtual ~BlobEngine() = default;

  // A store on the place: of one daemon, or of another daemon where several may have it.
  virtual std::unique_ptr<store::BlobStore> open() = 0;

  // Puts other bytes into the blob's place, wherever the store has them.
  virtual void spoil(const std::string& key, std::string_view bytes) = 0;

  // A file on the disk on which the last store that was opened takes files over.
  virtual std::string write_file(std::string_view bytes) = 0;

  // Everything in the store except blobs and permanent files.
  virtual std::vector<std::string> leftovers() = 0;
};

struct NamedBlobEngine {
  const char* name;
  std::unique_ptr<BlobEngine> (*make)();
  bool is_shared;
  std::string (*missing)();  // why it cannot be tested on this machine; empty when it can
};

std::vector<NamedBlobEngine> all_blob_engines();

inline std::string name_of_blobs(const testing::TestParamInfo<NamedBlobEngine>& engine) {
  return engine.param.name;
}

}  // namespace isomesh::test
