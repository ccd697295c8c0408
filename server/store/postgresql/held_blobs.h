#pragma once

#include <memory>
#include <string>
#include <vector>

#include "server/store/blob_store.h"
#include "server/store/postgresql/database.h"

namespace isomesh::store::postgresql {

// Blobs that several processes share: what one of them has stored and is about to name is safe from
// what the others erase. Who stores a blob and who erases it hold a lock of the database on its key
// meanwhile; a row says that it was stored. Thread safe; what it is made of must outlive it.
class HeldBlobs : public BlobStore {
 public:
  HeldBlobs(const BlobStore& blobs, Database& database) : blobs_(blobs), database_(database) {}

  std::unique_ptr<BlobWriter> begin() const override;
  bool has_room() const override { return blobs_.has_room(); }
  std::uint64_t bytes() const override { return blobs_.bytes(); }
  std::uint64_t capacity() const override { return blobs_.capacity(); }
  void adopt(const std::filesystem::path& file, const Blob& blob) const override;
  std::unique_ptr<BlobReader> open(const std::string& key) const override {
    return blobs_.open(key);
  }
  LocalBlob local(const std::string& key) const override { return blobs_.local(key); }
  bool is_intact(const std::string& key, const std::stop_token& stop) const override {
    return blobs_.is_intact(key, stop);
  }
  std::optional<std::uint64_t> size(const std::string& key) const override {
    return blobs_.size(key);
  }
  void erase(const std::string& key) const override { blobs_.erase(key); }
  void settle(const std::string& key) const override;
  std::vector<std::string> erase_unnamed(std::span<const std::string> keys, Steady unsettled,
                                         const Names& names) const override;
  Swept sweep(Steady unsettled, const Names& names) const override;
  std::size_t empty_quarantine(Time before) const override {
    return blobs_.empty_quarantine(before);
  }

 private:
  class Writer;

  // Has the blob stored by `store` while nobody can erase it, and held from then on.
  template <class Store>
  void hold(const std::string& key, const Store& store) const;
  bool is_held(const std::string& key, Steady since) const;

  const BlobStore& blobs_;
  Database& database_;
};

}  // namespace isomesh::store::postgresql
