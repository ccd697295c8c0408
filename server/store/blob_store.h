// Finished files, named by the SHA-256 of their bytes: the interface behind which engines stand.
//
// What an engine must have besides is a disk of this machine. Bytes are written there before they
// are a blob, since only then it is known what the blob is called; and what maps or opens a blob,
// which the processes `isomesh-job` and `isomesh-import` do in their sandboxes with a file or a
// descriptor that they are given, does so with a file of this machine (LocalBlob), whose bytes were
// checked.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "server/store/expiry.h"

namespace isomesh::store {

// What a blob is called and how long it is.
struct Blob {
  std::string key;  // hex SHA-256
  std::uint64_t bytes = 0;
};

// Reads a file, and lets the disk begin to write it meanwhile. Throws Error kOutOfSpace or
// kInternal.
Blob digest_of(const std::filesystem::path& file);

// Takes a blob's bytes in order. Not thread safe. What is not committed is removed.
class BlobWriter {
 public:
  virtual ~BlobWriter() = default;

  // Throws Error kOutOfSpace, and kTooLarge when there could never be enough room.
  virtual void write(std::span<const std::byte> bytes) = 0;

  // Afterwards the blob is there and outlives a crash. To be called once. Throws Error kOutOfSpace,
  // and kUnavailable where the store is elsewhere and does not answer.
  virtual Blob commit() = 0;
};

// An open blob; outlives its erasing. Thread safe.
class BlobReader {
 public:
  virtual ~BlobReader() = default;

  virtual std::uint64_t size() const = 0;

  // Reads up to bytes.size() bytes from `offset`; fewer only at the end. Throws Error kInternal.
  virtual std::size_t read_at(std::uint64_t offset, std::span<std::byte> bytes) const = 0;
};

// A blob as a file of this machine, to be mapped. The file is there for as long as this is: a store
// that has to fetch its blobs keeps the copy until `held` is released.
struct LocalBlob {
  std::filesystem::path path;
  std::shared_ptr<const void> held = {};
};

// What somebody who is given a link to a blob sees of it.
struct LinkedAs {
  std::string name;  // for those who save it; without control characters, quotes and backslashes
  std::string media_type;
  std::chrono::seconds lasts{60};
};

// What a sweep has done.
struct Swept {
  std::size_t quarantined = 0;
  std::size_t left = 0;  // blobs that nothing names either, but that would have been too many
};

// Whether a record names the blob of that key.
using Names = std::function<bool(const std::string& key)>;
// Makes room for so many bytes, or throws Error kOutOfSpace.
using MakeRoom = std::function<void(std::uint64_t bytes)>;
using Steady = std::chrono::steady_clock::time_point;

// A blob is seen whole or not at all, and never changes. Several daemons may have one store: what
// one of them stores, and is about to name, no other one erases or sweeps. Thread safe. Everything
// throws Error kUnavailable where the store is elsewhere and does not answer for a while; what was
// to be done then may have been done.
class BlobStore {
 public:
  virtual ~BlobStore() = default;

  // How many bytes all blobs may take, 0 for as many as there is room for, and what makes room. To
  // be called before anything is stored.
  virtual void limit_room(std::uint64_t max_bytes, MakeRoom make) = 0;

  // Whether the store does what it is asked for: quick, and asked again and again.
  virtual bool answers() const = 0;

  // Whether others than this daemon may have the store too.
  virtual bool is_shared() const = 0;

  // Whether it holds no blob at all.
  virtual bool is_empty() const = 0;

  // A short text that lies with the blobs and says whose they are (see Identity); empty without
  // one.
  virtual std::string mark() const = 0;
  virtual void set_mark(const std::string& text) const = 0;

  virtual std::unique_ptr<BlobWriter> begin() const = 0;

  // False while there is so little room that nothing new should be begun.
  virtual bool has_room() const = 0;

  // What all blobs take, those in quarantine and those that are being written included. Of what
  // other daemons have stored meanwhile the last sweep() knows.
  virtual std::uint64_t bytes() const = 0;

  // What they could take together if nothing else were stored, as far as this machine's disk, on
  // which they are written, and the limit let them.
  virtual std::uint64_t capacity() const = 0;

  // Makes a finished file of this machine a blob that outlives a crash, and removes it. `blob` is
  // what digest_of has just said of the file, so that is_intact() need not read it again. Throws
  // Error kOutOfSpace.
  virtual void adopt(const std::filesystem::path& file, const Blob& blob) const = 0;

  // What is read are bytes of this machine: one that is elsewhere is fetched first, and its bytes
  // are checked then. Throws Error kNotFound, and kInternal when they are not those of the key.
  virtual std::unique_ptr<BlobReader> open(const std::string& key) const = 0;

  // As open().
  virtual LocalBlob local(const std::string& key) const = 0;

  // Whether the bytes are those that the key names. A blob that was read whole and found intact is
  // not read again for a while, as long as nothing has touched it; one that several ask for is read
  // once. Throws Error kNotFound, and
  // kCancelled when `stop` is requested while it reads.
  virtual bool is_intact(const std::string& key, const std::stop_token& stop) const = 0;

  // In bytes; empty when it is not there.
  virtual std::optional<std::uint64_t> size(const std::string& key) const = 0;

  // An address under which anybody gets the bytes for a while, from where they are and not from
  // this daemon; empty where there is no such thing. Nothing is asked for: it may be of what is not
  // there.
  virtual std::optional<std::string> link(const std::string& key, const LinkedAs& as) const = 0;

  // Keeps what erasing a large blob takes long for (the disk frees its bytes) until this is let go;
  // null where there is nothing like that.
  virtual std::shared_ptr<const void> hold_bytes(const std::string& key) const = 0;

  // For who knows that nobody is about to name it. Nothing happens when it is not there. Those that
  // have it open keep what they have.
  virtual void erase(const std::string& key) const = 0;

  // A record names the blob from now on. Until then it is safe from erase_unnamed() and sweep(), by
  // whomever, for as long as they are told. To be called once for each time that it was stored.
  virtual void settle(const std::string& key) const = 0;

  // Erases those of `keys` that `names` does not name, but for those that were stored since
  // `unsettled` and are not settled. Returns those that are still there for that reason.
  virtual std::vector<std::string> erase_unnamed(std::span<const std::string> keys,
                                                 Steady unsettled, const Names& names) const = 0;

  // Puts what nothing names, by the same rule, into quarantine: a share of all blobs at most, since
  // what names nearly none of them is more likely wrong than they are. A blob in quarantine is
  // there for whoever asks for it. An engine for which this is much work does it now and then only.
  virtual Swept sweep(Steady unsettled, const Names& names) const = 0;

  // Removes what has been in quarantine since before that time and is not named by now. Returns how
  // many.
  virtual std::size_t empty_quarantine(Time before, const Names& names) const = 0;
};

// The same as is_intact, and false when it is not there.
bool is_there_and_intact(const BlobStore& blobs, const std::string& key,
                         const std::stop_token& stop);

}  // namespace isomesh::store
