#include "server/hospital/c_store/sender.h"

#include <memory>

#include "server/hospital/c_store/tls_relay.h"
#include "server/hospital/dimse/message.h"
#include "server/hospital/objects/encapsulated_document.h"
#include "server/net/connect.h"

namespace isomesh::c_store {
namespace {

using dimse::DimseEnd;
using orders::PacsFailure;
using orders::PacsFault;

// A response has a few bytes. A peer may be slow as long as it makes progress.
constexpr std::size_t kMostResponseBytes = 4096;
constexpr std::chrono::hours kLongest{24};
constexpr std::chrono::seconds kEnd{2};  // for a process to exit after it closed its socket

std::string hex_of(std::uint16_t status) {
  constexpr std::string_view kDigits = "0123456789ABCDEF";
  std::string text;
  for (int shift = 12; shift >= 0; shift -= 4) text += kDigits[(status >> shift) & 15];
  return text;
}

// Interprets the status of a C-STORE response (PS3.4, table B.2-1, and PS3.7, C).
void check_stored(std::uint16_t status) {
  const int high_byte = status >> 8;
  const int high_nibble = status >> 12;
  // A warning means that the object was stored.
  constexpr int kWarning = 0xB;
  // The UID depends on the contents, so this is the same object.
  constexpr std::uint16_t kDuplicate = 0x0111;
  if (status == 0 || high_nibble == kWarning || status == kDuplicate) return;
  const std::string said = "the PACS did not store the mesh; its status is " + hex_of(status);
  constexpr int kDoesNotMatch = 0xA9;
  constexpr int kCannotUnderstand = 0xC;
  if (high_byte == kDoesNotMatch || high_nibble == kCannotUnderstand) {
    throw PacsFailure(PacsFault::kRefused, said);
  }
  // Out of resources, or refused for a reason that an operator may remove.
  throw PacsFailure(PacsFault::kBusy, said);
}

void check_sent(const dimse::DimseSent& sent, std::string_view sop_class) {
  switch (sent.end) {
    case DimseEnd::kResponded:
      return check_stored(sent.status);
    case DimseEnd::kRejected:
      throw PacsFailure(PacsFault::kUnauthorized, "the PACS rejected the association");
    case DimseEnd::kBusy:
      throw PacsFailure(PacsFault::kBusy, "the PACS rejected the association for now");
    case DimseEnd::kNotAccepted:
      throw PacsFailure(PacsFault::kBusy,
                        "the PACS does not accept " + std::string(dicom::name_of_class(sop_class)));
    case DimseEnd::kUnanswered:
      throw PacsFailure(PacsFault::kUnreachable,
                        "the PACS did not answer the request for an association: it may expect "
                        "TLS, which tls = true switches on");
    case DimseEnd::kBroken:
      throw PacsFailure(PacsFault::kUnreachable, "the PACS ended the association");
    case DimseEnd::kTimeout:
      throw PacsFailure(PacsFault::kTimeout, "the PACS sent nothing for too long");
    case DimseEnd::kUnreadable:
      break;
  }
  throw PacsFailure(PacsFault::kUnreadable, "the response of the PACS cannot be read");
}

[[noreturn]] void throw_too_long(const std::string& limit) {
  throw PacsFailure(PacsFault::kTimeout,
                    "sending the object took too long: it ended after " + limit);
}

dimse::DimseSent sent_of(const process::Output& output, process::Child& child) {
  using Ending = process::Output::Ending;
  if (output.ending == Ending::kStopped) throw Error(ErrorCode::kCancelled, "stopped");
  if (output.ending == Ending::kTooLong) {
    throw_too_long(std::to_string(kLongest.count()) + " hours");
  }
  if (output.ending == Ending::kClosed && output.text.empty() &&
      process::is_out_of_time(child.ended_within(kEnd))) {
    throw_too_long("all of its processor time");
  }
  if (output.ending != Ending::kClosed || !output.text.ends_with('\n')) {
    return {.end = DimseEnd::kUnreadable, .status = 0};
  }
  const dimse::DimseReport report = dimse::dimse_report_from(output.text);
  if (const auto* sent = std::get_if<dimse::DimseSent>(&report)) return *sent;
  return {.end = DimseEnd::kUnreadable, .status = 0};
}

Descriptor connected(const orders::PacsSettings& settings, const std::stop_token& stop) {
  try {
    return net::connect_to(settings.host, settings.port, settings.timeout, stop);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kUnreachable) {
      throw PacsFailure(PacsFault::kUnreachable, "the connection to the PACS failed");
    }
    if (error.code() != ErrorCode::kRequestTimeout) throw;
    throw PacsFailure(PacsFault::kTimeout, "the PACS does not respond");
  }
}

// Empty if the PACS is reached without TLS.
std::unique_ptr<TlsRelay> encrypted(Descriptor& peer, const orders::PacsSettings& settings) {
  if (!settings.tls) return nullptr;
  try {
    const net::TlsContext context = net::tls_client_context(
        {.certificate = {.option = "certificate-file", .path = settings.certificate_file},
         .key = {.option = "key-file", .path = settings.key_file},
         .authorities = {.option = "ca-file", .path = settings.ca_file}});
    auto stream = std::make_unique<net::TlsStream>(context.get(), peer.release(),
                                                   net::TlsStream::Side::kClient);
    const std::string& name =
        settings.certificate_name.empty() ? settings.host : settings.certificate_name;
    if (name != "*") net::expect_name(stream->ssl(), name);
    auto relay = std::make_unique<TlsRelay>(std::move(stream));
    peer = relay->take_plain_end();
    return relay;
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kInvalidParameter) throw;
    throw PacsFailure(PacsFault::kUnauthorized,
                      std::string("TLS with the PACS cannot be started: ") + error.what());
  }
}

// Throws if an association ended because of its TLS.
void check_encryption(const TlsRelay& tls, DimseEnd end) {
  const net::TlsFault fault = tls.fault();
  if (fault != net::TlsFault::kNone) {
    throw PacsFailure(
        fault == net::TlsFault::kRefused ? PacsFault::kUnauthorized : PacsFault::kUnreachable,
        net::text_of(fault, "the PACS"));
  }
  if (tls.has_ended_silently()) {
    throw PacsFailure(PacsFault::kUnreachable,
                      "the PACS ended the TLS connection before it answered: it may refuse the "
                      "certificate of isomeshd, or not use TLS on this port");
  }
  if (end == DimseEnd::kUnanswered) {
    throw PacsFailure(PacsFault::kUnreachable,
                      "the PACS did not answer the request for an association");
  }
}

}  // namespace

void Sender::store(const orders::OutgoingObject& object, const std::stop_token& stop) {
  // As for DICOMweb: one more second for each 4 MiB to store.
  constexpr std::uint64_t kBytesPerSecond = std::uint64_t{4} << 20;
  const dimse::DimseSending order = {
      .calling = settings_.calling_aet,
      .called = settings_.aet,
      .file = object.file.path,
      .sop_class = object.sop_class,
      .instance = object.place.instance,
      .timeout = settings_.timeout,
      .response_timeout = settings_.timeout + std::chrono::seconds(object.bytes / kBytesPerSecond)};
  Descriptor peer = connected(settings_, stop);
  const std::unique_ptr<TlsRelay> tls = encrypted(peer, settings_);
  process::Child child =
      processes_.take(std::chrono::steady_clock::now() + settings_.timeout, stop);
  child.send(dimse::to_line(order), peer.number());
  peer = Descriptor();  // so that TLS ends when the process ends
  const process::Output output =
      child.receive(kMostResponseBytes, std::chrono::steady_clock::now() + kLongest, stop);
  const dimse::DimseSent sent = sent_of(output, child);
  if (sent.end == DimseEnd::kUnreadable) processes_.renew();
  if (tls && sent.end != DimseEnd::kResponded) check_encryption(*tls, sent.end);
  check_sent(sent, object.sop_class);
}

}  // namespace isomesh::c_store
