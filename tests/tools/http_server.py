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
                        "s/e+cret" has signed for the region "test-1"; lists them too

GET /requests returns how many there were, and how many bytes were sent; GET /reset sets both to 0.
"""

import asyncio
import hashlib
import hmac
import os
import sys
import time
from urllib.parse import parse_qsl, quote, unquote, urlsplit

REASONS = {200: "OK", 206: "Partial Content", 304: "Not Modified",
           403: "Forbidden", 404: "Not Found", 412: "Changed",
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
    if not {"host", "x-amz-date", "x-amz-content-sha256"} <= set(names):
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
        parts = urlsplit(line[1])
        path = unquote(parts.path).strip("/")
        if path in ("requests", "reset"):
            if path == "reset":
                self.requests = self.bytes = 0
            return await self.send(writer, 200, f"{self.requests} {self.bytes}".encode())
        self.requests += 1
        mode, _, name = path.partition("/")
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
        if mode == "bucket":
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

    def listing(self, query):
        """What is directly below a prefix, a name at a time, so that lists have several parts."""
        query = dict(parse_qsl(query))
        prefix, after = query["prefix"], query.get("continuation-token", "")
        found = {}
        for folder, _, files in os.walk(self.folder):
            for file in files:
                key = os.path.relpath(os.path.join(folder, file), self.folder)
                if key.startswith(prefix):
                    rest, slash, _ = key[len(prefix):].partition("/")
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
