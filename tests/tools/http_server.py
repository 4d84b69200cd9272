"""A server of the files in a folder, with faults: http_server.py FOLDER [PORT_FILE].

Prints its port. The first part of a path names what is wrong with it:

    /plain/…            nothing
    /slow:MS/…          a pause before each reply
    /link:MBPS:MS/…     a link of so many MB/s that all replies share, and a pause
    /fail:STATUS:N/…    the first N requests of each object and range get this status
    /reset:N/…          … or end without a reply
    /short:N/…          … or end in the middle of the body
    /wrong:N/…          … or have the bytes of another range
    /hang:N/…           … or never get a reply
    /noranges/…         answers as if no range was requested
    /forbidden/…        403 for what is missing
    /changing/…         another ETag at each reply
    /secret/…           403 without "?token=abc"
    /bucket/…           as S3: the keys of a bucket, for requests that key "AKTEST" with the secret
                        "s/e+cret" has signed for the region "test-1"; lists them too, and
                        objects can be written and removed, also in parts
    /bucket-FAULT/…     … where writing fails: "busy" (each first try of it gets 503), "reset" (or
                        ends without a reply), "late" (an upload in parts is complete, but the first
                        reply is lost), "denied" (the second part gets 403), "false" (completing
                        it fails with the status 200), "hang" (the second part gets no reply),
                        "slow" (a pause before each reply)

GET /requests returns how many there were, and how many bytes were sent; GET /reset sets both to 0.
GET /uploads returns how many uploads in parts are not complete, and how many were.
"""

import asyncio
import hashlib
import hmac
import os
import sys
import time
from urllib.parse import parse_qsl, quote, unquote, urlsplit

REASONS = {200: "OK", 204: "No Content", 206: "Partial Content", 304: "Not Modified",
           400: "Bad Request", 403: "Forbidden", 404: "Not Found", 412: "Changed",
           416: "Range Not Satisfiable", 429: "Too Many Requests", 500: "Error",
           503: "Service Unavailable"}


def is_signed(line, headers):
    """Whether a request has the signature of AWS's version 4."""
    scheme, _, rest = headers.get("authorization", "").partition(" ")
    if scheme != "AWS4-HMAC-SHA256":
        return False
    fields = dict(f.strip().split("=", 1) for f in rest.split(","))
    key, day, region, service, last = fields["Credential"].split("/")
    if (key, region, service, last) != ("AKTEST", "test-1", "s3", "aws4_request"):
        return False
    parts = urlsplit(line[1])
    names = fields["SignedHeaders"].split(";")
    if not {"host", "x-amz-date", "x-amz-content-sha256"} <= set(names) <= set(headers):
        return False
    query = "&".join(f"{quote(k, safe='-_.~')}={quote(v, safe='-_.~')}"
                     for k, v in sorted(parse_qsl(parts.query, keep_blank_values=True)))
    canonical = "\n".join([line[0], parts.path, query,
                           *(f"{n}:{' '.join(headers[n].split())}" for n in names), "",
                           ";".join(names), headers["x-amz-content-sha256"]])
    scope = "/".join([day, region, service, last])
    text = "\n".join(["AWS4-HMAC-SHA256", headers["x-amz-date"], scope,
                      hashlib.sha256(canonical.encode()).hexdigest()])
    signing = b"AWS4s/e+cret"
    for part in (day, region, service, last):
        signing = hmac.new(signing, part.encode(), hashlib.sha256).digest()
    return hmac.new(signing, text.encode(), hashlib.sha256).hexdigest() == fields["Signature"]


class Server:
    def __init__(self, folder):
        self.folder = folder
        self.seen = {}
        self.requests = self.bytes = self.changes = 0
        self.link_free = 0.0
        self.uploads = {}
        self.completed = 0
        self.written = []

    async def run(self, reader, writer):
        try:
            while await self.reply(reader, writer):
                pass
        except (ConnectionError, asyncio.IncompleteReadError):
            pass
        finally:
            writer.close()

    async def reply(self, reader, writer):
        line = (await reader.readline()).decode("latin-1").split()
        if len(line) < 2:
            return False
        headers = {}
        while (header := (await reader.readline()).strip()):
            name, _, value = header.decode("latin-1").partition(":")
            headers[name.lower()] = value.strip()
        if headers.get("expect") == "100-continue":
            writer.write(b"HTTP/1.1 100 Continue\r\n\r\n")
        body = await reader.readexactly(int(headers.get("content-length", 0)))
        parts = urlsplit(line[1])
        path = unquote(parts.path).strip("/")
        if path == "uploads":
            return await self.send(writer, 200, f"{len(self.uploads)} {self.completed}".encode())
        if path == "written":
            return await self.send(writer, 200, "\n".join(self.written).encode())
        if path in ("requests", "reset"):
            if path == "reset":
                self.requests = self.bytes = 0
            return await self.send(writer, 200, f"{self.requests} {self.bytes}".encode())
        self.requests += 1
        mode, _, name = path.partition("/")
        if line[0] in ("PUT", "POST", "DELETE"):
            if not mode.startswith("bucket") or not is_signed(line, headers):
                return await self.send(writer, 403, b"<Error><Code>AccessDenied</Code></Error>")
            return await self.write(writer, line, mode, name, parts.query, body)
        mode, *numbers = mode.split(":")
        return await self.answer(writer, line, mode, [int(n) for n in numbers], name, headers,
                                 parts.query)

    async def answer(self, writer, line, mode, numbers, name, headers, query):
        if os.environ.get("HTTP_LOG"):
            print("%.3f" % time.monotonic(), name, headers.get("range"), file=sys.stderr, flush=True)
        tries = self.seen.get((mode, name, headers.get("range")), 0) + 1
        self.seen[mode, name, headers.get("range")] = tries
        fails = mode in ("fail", "reset", "short", "wrong", "hang") and tries <= numbers[-1]
        if mode == "slow":
            await asyncio.sleep(numbers[0] / 1000)
        if mode == "fail" and fails:
            return await self.send(writer, numbers[0], b"<Code>Slow</Code><Message>down</Message>")
        if mode == "hang" and fails:
            await asyncio.sleep(3600)
        if mode == "reset" and fails:
            writer.transport.abort()
            return False
        if mode.startswith("bucket"):
            if not is_signed(line, headers):
                return await self.send(writer, 403, b"<Error><Code>SignatureDoesNotMatch</Code>")
            if not name:
                return await self.send(writer, 200, self.listing(query))
        if mode == "secret" and query != "token=abc":
            return await self.send(writer, 403)
        file = os.path.join(self.folder, name)
        if not os.path.isfile(file):
            return await self.send(writer, 403 if mode == "forbidden" else 404)
        state = os.stat(file)
        size = state.st_size
        self.changes += mode == "changing"
        tag = '"%x-%x-%x"' % (state.st_mtime_ns, size, self.changes)
        if headers.get("if-match", tag) != tag:
            return await self.send(writer, 412)
        if headers.get("if-none-match") == tag:
            return await self.send(writer, 304)
        more, status, begin, end = [f"ETag: {tag}"], 200, 0, size
        if "range" in headers and mode != "noranges":
            first, _, last = headers["range"].removeprefix("bytes=").partition("-")
            if int(first) >= size:
                return await self.send(writer, 416, b"", [f"Content-Range: bytes */{size}"])
            wrong = 1 if mode == "wrong" and fails else 0
            begin, end, status = int(first) + wrong, min(int(last) + 1, size) + wrong, 206
            more.append(f"Content-Range: bytes {begin}-{end - 1}/{size}")
        with open(file, "rb") as opened:
            opened.seek(begin)
            data = opened.read(end - begin)
        if mode == "link":
            # All replies go through one link, one after another.
            now = time.monotonic()
            self.link_free = max(self.link_free, now) + len(data) / (numbers[0] * 1e6)
            await asyncio.sleep(self.link_free - now + numbers[1] / 1000)
        if mode == "short" and fails and data:
            await self.send(writer, status, data, more, len(data) // 2)
            return False
        return await self.send(writer, status, data, more)

    async def write(self, writer, line, mode, name, query, body):
        """PUT, POST and DELETE of a bucket."""
        file = os.path.join(self.folder, name)
        query = dict(parse_qsl(query, keep_blank_values=True))
        upload = query.get("uploadId")
        tries = self.seen.get((*line, mode), 0) + 1
        self.seen[(*line, mode)] = tries
        if mode == "bucket-busy" and tries == 1:
            return await self.send(writer, 503, b"<Error><Code>SlowDown</Code></Error>")
        if mode == "bucket-reset" and tries == 1:
            writer.transport.abort()
            return False
        if mode == "bucket-denied" and query.get("partNumber") == "2":
            return await self.send(writer, 403, b"<Error><Code>AccessDenied</Code></Error>")
        if mode == "bucket-slow":
            await asyncio.sleep(0.2)
        if mode == "bucket-hang" and query.get("partNumber") == "2":
            await asyncio.sleep(3600)
        if upload is not None and upload not in self.uploads:
            return await self.send(writer, 404, b"<Error><Code>NoSuchUpload</Code></Error>")
        if line[0] == "DELETE":
            if upload:
                del self.uploads[upload]
            elif os.path.exists(file):
                os.remove(file)
                self.written.append("-" + name)
            return await self.send(writer, 204)
        if "uploads" in query:
            upload = f"id/+{len(self.seen)}=="
            self.uploads[upload] = {}
            return await self.send(writer, 200, f"<UploadId>{upload}</UploadId>".encode())
        if line[0] == "PUT" and upload:
            tag = f'"{hashlib.md5(body).hexdigest()}"'
            self.uploads[upload][int(query["partNumber"])] = (tag, body)
            return await self.send(writer, 200, b"", [f"ETag: {tag}"])
        if line[0] == "POST":
            if mode == "bucket-false":
                return await self.send(writer, 200, b"<Error><Code>InternalError</Code></Error>")
            parts = sorted(self.uploads[upload].items())
            expected = "".join(f"<Part><PartNumber>{n}</PartNumber><ETag>{tag}</ETag></Part>"
                               for n, (tag, _) in parts)
            small = any(len(data) < 5 << 20 for _, (_, data) in parts[:-1])
            if small or body.decode() != f"<CompleteMultipartUpload>{expected}</CompleteMultipartUpload>":
                return await self.send(writer, 400, b"<Error><Code>InvalidPart</Code></Error>")
            body = b"".join(data for _, (_, data) in parts)
            del self.uploads[upload]
            self.completed += 1
        os.makedirs(os.path.dirname(file), exist_ok=True)
        with open(file, "wb") as opened:
            opened.write(body)
        self.written.append(name)
        if mode == "bucket-late" and upload:
            writer.transport.abort()
            return False
        return await self.send(writer, 200, b"<CompleteMultipartUploadResult/>" if upload else b"")

    def listing(self, query):
        """What is directly below a prefix, a name at a time, so that lists have several parts."""
        query = dict(parse_qsl(query))
        prefix, after = query["prefix"], query.get("continuation-token", "")
        found = {}
        for folder, _, files in os.walk(self.folder):
            for file in files:
                key = os.path.relpath(os.path.join(folder, file), self.folder)
                if key.startswith(prefix):
                    delimiter = query.get("delimiter", "\0")
                    rest, slash, _ = key[len(prefix):].partition(delimiter)
                    found[prefix + rest + slash] = bool(slash)
        names = sorted(n for n in found if n > after)
        text = "<ListBucketResult>"
        if len(names) > 1:
            text += f"<IsTruncated>true</IsTruncated><NextContinuationToken>{names[0]}"
            text += "</NextContinuationToken>"
        for name in names[:1]:
            text += (f"<CommonPrefixes><Prefix>{name}</Prefix></CommonPrefixes>" if found[name] else
                     f"<Contents><Key>{name}</Key></Contents>")
        return (text + "</ListBucketResult>").encode()

    async def send(self, writer, status, data=b"", more=(), count=None):
        head = [f"HTTP/1.1 {status} {REASONS[status]}", f"Content-Length: {len(data)}", *more]
        data = data[:count]
        self.bytes += len(data)
        writer.write("\r\n".join(head).encode() + b"\r\n\r\n" + data)
        await writer.drain()
        return True


async def main():
    server = Server(sys.argv[1])
    listening = await asyncio.start_server(server.run, "127.0.0.1", 0, limit=1 << 20)
    print(listening.sockets[0].getsockname()[1], flush=True)
    async with listening:
        await listening.serve_forever()


asyncio.run(main())
