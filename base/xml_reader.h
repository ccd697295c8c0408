// XML documents of strangers, read piece by piece.
#pragma once

#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string_view>

struct XML_ParserStruct;

namespace isomesh {

// Of one element, valid while it is handled; no name twice.
class XmlAttributes {
 public:
  // `pairs`: names and values by turns, up to a null.
  explicit XmlAttributes(const char* const* pairs) : pairs_(pairs) {}

  std::optional<std::string_view> find(std::string_view name) const;

  template <class Visit>
  void for_each(const Visit& visit) const {
    for (const char* const* pair = pairs_; *pair != nullptr; pair += 2) visit(pair[0], pair[1]);
  }

 private:
  const char* const* pairs_;
};

// What is done with a document. What one of these throws ends the reading, and is thrown by it.
class XmlHandler {
 public:
  virtual ~XmlHandler() = default;
  virtual void start_element(std::string_view name, const XmlAttributes& attributes) = 0;
  virtual void end_element(std::string_view /*name*/) {}
  // In UTF-8; one text may come in several parts.
  virtual void text(std::string_view /*part*/) {}
  // What the document's declaration says; not called without one that does.
  virtual void encoding(std::string_view /*name*/) {}
};

// The document cannot be read; what() is a part of a sentence that says why, and in which line.
struct XmlError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

// Nothing in a document makes it read a file or take much more memory than the longest tag: to
// declare an entity, which may grow without bounds, is an XmlError.
class XmlReader {
 public:
  explicit XmlReader(XmlHandler& handler);
  ~XmlReader();
  XmlReader(const XmlReader&) = delete;
  XmlReader& operator=(const XmlReader&) = delete;

  // The next bytes; nothing happens after stop(). Throws XmlError, and what the handler throws.
  void read(std::string_view piece, bool is_last);

  // Called by a handler: nothing more is read.
  void stop();
  bool is_stopped() const { return is_stopped_; }

  // Of what is handled, or else read, in bytes from the document's beginning: where it starts and
  // ends.
  std::uint64_t begin() const;
  std::uint64_t end() const;

 private:
  struct Callbacks;
  struct Free {
    void operator()(XML_ParserStruct* parser) const;
  };

  [[noreturn]] void throw_unreadable(std::string_view reason) const;

  XmlHandler& handler_;
  const std::unique_ptr<XML_ParserStruct, Free> parser_;
  std::exception_ptr failure_;
  bool is_stopped_ = false;
};

}  // namespace isomesh
