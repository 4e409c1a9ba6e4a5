; Tells again and again how many images there are, how many layers the picture has, and what its chosen layer looks
; like; until there is no image.

(define (tell name value)
  (let ((port (open-output-file (string-append scratch "/" name))))
    (display value port)
    (close-output-port port)))

(define (watch picture)
  (let ((layer (car (gimp-image-get-active-layer picture)))
        (shown (string-append scratch "/shown.png")))
    (tell "images" (car (gimp-image-list)))
    (tell "layers" (car (gimp-image-get-layers picture)))
    (file-png-save RUN-NONINTERACTIVE picture layer shown shown FALSE 1 FALSE FALSE FALSE FALSE FALSE)
    (usleep 300000)
    (if (> (car (gimp-image-is-valid picture)) 0)
        (watch picture))))
(watch (vector-ref (cadr (gimp-image-list)) 0))
