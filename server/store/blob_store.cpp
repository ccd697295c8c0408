#include "server/store/blob_store.h"

#include <vector>

namespace isomesh::store {
namespace {

// Folders of many thousand files are slow to list; the first byte of the key splits them.
constexpr std::size_t kPrefix = 2;
constexpr std::size_t kBlockBytes = std::size_t{1} << 20;

}  // namespace

BlobStore::Writer::Writer(const BlobStore& store)
    : store_(store),
      path_(store.folder_.scratch() / (random_hex(8) + ".blob")),
      file_(File::create(path_)) {}

BlobStore::Writer::~Writer() {
  std::error_code ignored;  // a committed one is gone from here already
  std::filesystem::remove(path_, ignored);
}

void BlobStore::Writer::write(std::span<const std::byte> bytes) {
  file_.write(bytes);
  digest_.update(bytes);
  bytes_ += bytes.size();
}

Blob BlobStore::Writer::commit() {
  file_.sync();
  const std::string key = to_hex(digest_.finish());
  store_.publish_as(path_, key);
  return {key, bytes_};
}

Blob digest_of(const std::filesystem::path& path) {
  File file = File::open(path);
  Sha256 digest;
  std::vector<std::byte> block(kBlockBytes);
  std::uint64_t offset = 0;
  while (const std::size_t count = file.read_at(offset, block)) {
    digest.update(std::span(block).first(count));
    offset += count;
  }
  file.sync();
  return {to_hex(digest.finish()), offset};
}

void BlobStore::adopt(const std::filesystem::path& file, const Blob& blob) const {
  publish_as(file, blob.key);
}

File BlobStore::open(const std::string& key) const { return File::open(path_of(key)); }

std::filesystem::path BlobStore::path_of(const std::string& key) const {
  return folder_.blobs() / key.substr(0, kPrefix) / key;
}

void BlobStore::erase(const std::string& key) const {
  std::error_code ignored;
  std::filesystem::remove(path_of(key), ignored);
}

void BlobStore::sweep(const std::function<bool(const std::string& key)>& keep) const {
  std::vector<std::string> unnamed;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder_.blobs())) {
    const std::string key = entry.path().filename();
    if (entry.is_regular_file() && !keep(key)) unnamed.push_back(key);
  }
  for (const std::string& key : unnamed) erase(key);
}

void BlobStore::publish_as(const std::filesystem::path& file, const std::string& key) const {
  const std::filesystem::path place = path_of(key);
  if (std::filesystem::create_directory(place.parent_path())) {
    sync_folder(folder_.blobs());
  }
  publish(file, place);
}

}  // namespace isomesh::store
