#include "server/store/postgresql/held_blobs.h"

#include <spdlog/spdlog.h>

#include "base/hex.h"
#include "base/sha256.h"

namespace isomesh::store::postgresql {
namespace {

// A lock of the database on a key, as long as this lives or its connection.
class KeyLock {
 public:
  enum class Kind { kShared, kAlone };

  // Waits for a shared one. Throws Interrupted when that takes too long.
  KeyLock(Connection& connection, const std::string& key, Kind kind)
      : connection_(connection), key_(key), kind_(kind) {
    if (kind == Kind::kShared) {
      connection.run("SELECT pg_advisory_lock_shared(hashtextextended($1::text, 19))", key);
      is_held_ = true;
    } else {
      Rows row = connection.run("SELECT pg_try_advisory_lock(hashtextextended($1::text, 19))", key);
      row.next();
      is_held_ = row.boolean(0);
    }
  }
  ~KeyLock() {
    if (!is_held_) return;
    try {
      connection_.run(kind_ == Kind::kShared
                          ? "SELECT pg_advisory_unlock_shared(hashtextextended($1::text, 19))"
                          : "SELECT pg_advisory_unlock(hashtextextended($1::text, 19))",
                      key_);
    } catch (const Error&) {
      return;  // lost, and the lock with it
    }
  }
  KeyLock(const KeyLock&) = delete;
  KeyLock& operator=(const KeyLock&) = delete;

  bool is_held() const { return is_held_; }

 private:
  Connection& connection_;
  const std::string& key_;
  const Kind kind_;
  bool is_held_ = false;
};

}  // namespace

// The key has to be known before the blob is there, so it is made here, too.
class HeldBlobs::Writer : public BlobWriter {
 public:
  Writer(const HeldBlobs& store, std::unique_ptr<BlobWriter> writer)
      : store_(store), writer_(std::move(writer)) {}

  void write(std::span<const std::byte> bytes) override {
    writer_->write(bytes);
    digest_.update(bytes);
  }

  Blob commit() override {
    Blob blob;
    store_.hold(to_hex(digest_.finish()), [&] { blob = writer_->commit(); });
    return blob;
  }

 private:
  const HeldBlobs& store_;
  const std::unique_ptr<BlobWriter> writer_;
  Sha256 digest_;
};

std::unique_ptr<BlobWriter> HeldBlobs::begin() const {
  return std::make_unique<Writer>(*this, blobs_.begin());
}

void HeldBlobs::adopt(const std::filesystem::path& file, const Blob& blob) const {
  hold(blob.key, [&] { blobs_.adopt(file, blob); });
}

template <class Store>
void HeldBlobs::hold(const std::string& key, const Store& store) const {
  database_.ask([&](Connection& connection, bool) {
    const KeyLock lock(connection, key, KeyLock::Kind::kShared);
    connection.run(
        "INSERT INTO holds VALUES($1::text, $2::uuid, isomesh_now(), 1) ON CONFLICT(blob, node) DO "
        "UPDATE SET at = excluded.at, times = holds.times + 1",
        key, database_.node());
    store();
  });
}

void HeldBlobs::settle(const std::string& key) const {
  blobs_.settle(key);
  try {
    const std::size_t released =
        database_
            .run("DELETE FROM holds WHERE blob = $1::text AND node = $2::uuid AND times <= 1", key,
                 database_.node())
            .changed();
    if (released > 0) return;
    database_.run("UPDATE holds SET times = times - 1 WHERE blob = $1::text AND node = $2::uuid",
                  key, database_.node());
  } catch (const Error& error) {
    // What was stored is named by now; held for longer, it is only erased later.
    spdlog::debug("a blob is held for longer: {}", error.what());
  }
}

bool HeldBlobs::is_held(const std::string& key, Steady since) const {
  return database_
      .run("SELECT 1 FROM holds WHERE blob = $1::text AND at >= $2::bigint", key,
           database_.us_of(since))
      .next();
}

std::vector<std::string> HeldBlobs::erase_unnamed(std::span<const std::string> keys,
                                                  Steady unsettled, const Names& names) const {
  std::vector<std::string> left;
  for (const std::string& key : keys) {
    const bool is_left = database_.ask([&](Connection& connection, bool) {
      const KeyLock lock(connection, key, KeyLock::Kind::kAlone);
      if (!lock.is_held()) return true;
      if (names(key)) return false;
      if (is_held(key, unsettled)) return true;
      return !blobs_.erase_unnamed(std::span(&key, 1), unsettled, names).empty();
    });
    if (is_left) left.push_back(key);
  }
  return left;
}

Swept HeldBlobs::sweep(Steady unsettled, const Names& names) const {
  const Swept swept = blobs_.sweep(
      unsettled, [&](const std::string& key) { return names(key) || is_held(key, unsettled); });
  database_.run("DELETE FROM holds WHERE at < $1::bigint", database_.us_of(unsettled));
  return swept;
}

}  // namespace isomesh::store::postgresql
